//! A way that is driven, as centre lines: what is driven twice becomes one street.

use gyre_geometry::Pose;
use nalgebra::{Point2, Rotation2, Vector2};

use super::lines::{Line, LineGrid, Segment, length_m};
use crate::lanes::{DrivingSide, LANE_M};
use crate::path::Path;

/// Metres between points of the way.
const STEP_M: f64 = 2.0;
/// A way that runs less than so many metres beside a street is on it.
const JOIN_M: f64 = 8.0;
/// And one that is on it leaves it farther away only.
const LEAVE_M: f64 = 11.0;
/// Cosine of the angle up to which two directions are parallel.
const PARALLEL: f64 = 0.85;
/// Metres to either side over which a street's shift to the middle of what was driven is averaged.
const SHIFT_M: f64 = 20.0;
/// A way that turns by more than the angle (radians) within the length (metres) takes another street.
const TURN: (f64, f64) = (0.9, 24.0);

/// A point of the way that is driven.
#[derive(Clone, Copy, Debug)]
pub struct WayPoint {
    /// Where the vehicle is.
    pub vehicle: Point2<f64>,
    /// The middle of its street, by the lane that it keeps to.
    pub centre: Point2<f64>,
    /// Which way it looks, a unit vector.
    pub ahead: Vector2<f64>,
    /// When, seconds.
    pub time_s: f64,
}

/// The way of a drive, a point every two metres.
pub fn way(path: &dyn Path, duration_s: f64, keep: DrivingSide) -> Vec<WayPoint> {
    let poses = steps(path, duration_s);
    let to_centre = match keep {
        DrivingSide::Left => -LANE_M / 2.0,
        DrivingSide::Right => LANE_M / 2.0,
    };
    let point = |index: usize| {
        let (time_s, pose) = poses[index];
        let ahead = direction(&poses, index);
        let vehicle = Point2::from(pose.translation.vector);
        let centre = vehicle + Vector2::new(-ahead.y, ahead.x) * to_centre;
        WayPoint {
            vehicle,
            centre,
            ahead,
            time_s,
        }
    };
    (0..poses.len()).map(point).collect()
}

/// Poses with their times, each some metres from the one before; at least two, the last of them ahead of a vehicle that stands.
fn steps(path: &dyn Path, duration_s: f64) -> Vec<(f64, Pose)> {
    let mut poses = vec![(0.0, path.pose(0.0))];
    let apart = |a: &Pose, b: &Pose| (a.translation.vector - b.translation.vector).norm();
    for step in 1..=(duration_s / 0.05) as usize {
        let time_s = 0.05 * step as f64;
        let pose = path.pose(time_s);
        if apart(&pose, &poses[poses.len() - 1].1) >= STEP_M {
            poses.push((time_s, pose));
        }
    }
    let (_, last) = poses[poses.len() - 1];
    poses.push((duration_s, last * gyre_geometry::pose(STEP_M, 0.0, 0.0)));
    poses
}

/// The direction of the way where the vehicle looks ahead along it; its own where it turns on the spot.
fn direction(poses: &[(f64, Pose)], index: usize) -> Vector2<f64> {
    let (before, after) = (
        poses[index.saturating_sub(1)].1,
        poses[(index + 1).min(poses.len() - 1)].1,
    );
    let chord = after.translation.vector - before.translation.vector;
    let looks = poses[index].1.rotation * Vector2::x();
    let along = chord.dot(&looks);
    if along.abs() < 0.7 * chord.norm() || chord.norm() < STEP_M {
        looks
    } else {
        chord.normalize() * along.signum()
    }
}

/// Centre lines of the streets that a way takes, each once.
pub fn driven_lines(way: &[WayPoint]) -> Vec<Line> {
    let mut merger = Merger::default();
    for point in way {
        merger.go(point);
    }
    merger
        .finish()
        .iter()
        .flat_map(|line| cut_at_turns(line))
        .filter(|line| length_m(line) > 0.0)
        .collect()
}

#[derive(Debug, Default)]
struct Merger {
    lines: Vec<Line>,
    /// For each point of each line how far to its left and right the way passed, metres to the left.
    spans: Vec<Vec<[f64; 2]>>,
    grid: LineGrid,
    /// Whether the last line is being drawn.
    drawing: bool,
    /// Where the way was last on a street that was there before.
    joined: Option<Point2<f64>>,
}

impl Merger {
    fn go(&mut self, point: &WayPoint) {
        let reach_m = if self.drawing { JOIN_M } else { LEAVE_M };
        let beside = |segment: &&Segment| {
            (0.0..=1.0).contains(&segment.share(point.centre))
                && segment.direction().dot(&point.ahead).abs() > PARALLEL
        };
        let apart = |segment: &Segment| (segment.foot(point.centre) - point.centre).norm();
        let found = self
            .grid
            .near(point.centre, reach_m)
            .filter(beside)
            .min_by(|a, b| apart(a).total_cmp(&apart(b)));
        match found.copied() {
            Some(street) => self.join(&street, point.centre),
            None => self.draw(point),
        }
    }

    fn join(&mut self, street: &Segment, centre: Point2<f64>) {
        let foot = street.foot(centre);
        if self.drawing {
            self.append(foot);
            self.drawing = false;
        }
        self.joined = Some(foot);
        let left_m = street.left_m(centre);
        for span in &mut self.spans[street.line][street.point..=street.point + 1] {
            *span = [span[0].min(left_m), span[1].max(left_m)];
        }
    }

    fn draw(&mut self, point: &WayPoint) {
        if !self.drawing {
            self.lines.push(Line::new());
            self.spans.push(Vec::new());
            self.drawing = true;
            let near = |joined: &Point2<f64>| (point.centre - joined).norm() < 2.0 * LEAVE_M;
            if let Some(joined) = self.joined.take().filter(near) {
                self.append(joined);
            }
        }
        self.append(point.centre);
    }

    fn append(&mut self, place: Point2<f64>) {
        let number = self.lines.len() - 1;
        let line = &mut self.lines[number];
        if let Some(last) = line.last().copied() {
            if (place - last).norm() < STEP_M / 2.0 {
                return;
            }
            self.grid.add(number, line.len() - 1, last, place);
        }
        line.push(place);
        self.spans[number].push([0.0; 2]);
    }

    /// The lines, each in the middle of all that was driven on it.
    fn finish(self) -> Vec<Line> {
        self.lines
            .iter()
            .zip(&self.spans)
            .map(|(line, spans)| centred(line, spans))
            .collect()
    }
}

fn centred(line: &Line, spans: &[[f64; 2]]) -> Line {
    let reach = (SHIFT_M / STEP_M) as usize;
    let shifted = |index: usize| {
        // The ends stay where other lines begin.
        let reach = reach.min(index).min(line.len() - 1 - index);
        let around = &spans[index - reach..=index + reach];
        let end = if reach == 0 { 0.0 } else { 1.0 };
        let left_m = end
            * around
                .iter()
                .map(|span| 0.5 * (span[0] + span[1]))
                .sum::<f64>()
            / around.len() as f64;
        let along = line[(index + 1).min(line.len() - 1)] - line[index.saturating_sub(1)];
        let left = Rotation2::new(std::f64::consts::FRAC_PI_2)
            * along.try_normalize(0.0).unwrap_or_default();
        line[index] + left * left_m
    };
    (0..line.len()).map(shifted).collect()
}

/// Cuts a line where it turns off, in the middle of the turn.
fn cut_at_turns(line: &[Point2<f64>]) -> Vec<Line> {
    let reach = (TURN.1 / STEP_M / 2.0) as usize;
    let turn = |index: usize| {
        let along = |from: usize, to: usize| {
            (line[to] - line[from])
                .try_normalize(0.0)
                .unwrap_or_default()
        };
        along(index - reach, index).angle(&along(index, index + reach))
    };
    let mut pieces = Vec::new();
    let mut start = 0;
    let mut index = reach;
    while index + reach < line.len() {
        if turn(index) < TURN.0 {
            index += 1;
            continue;
        }
        let sharpest = (index..(index + 2 * reach).min(line.len() - reach))
            .max_by(|a, b| turn(*a).total_cmp(&turn(*b)));
        let corner = sharpest.unwrap_or(index);
        pieces.push(line[start..=corner].to_vec());
        start = corner;
        index = corner + 2 * reach;
    }
    pieces.push(line[start..].to_vec());
    pieces
}
