//! The driven path as centre lines: passes along the same street are merged.

use gyre_geometry::Pose;
use nalgebra::{Point2, Rotation2, Vector2};

use super::lines::{Line, LineGrid, Segment, length_m};
use crate::lanes::{DrivingSide, LANE_M};
use crate::path::Path;

/// Distance between waypoints, metres.
const STEP_M: f64 = 2.0;
/// A path joins a street when it runs closer beside it than this, metres.
const JOIN_M: f64 = 8.0;
/// A path leaves its street when it is farther away than this, metres.
const LEAVE_M: f64 = 11.0;
/// Minimum cosine of the angle between parallel directions.
const PARALLEL: f64 = 0.85;
/// Distance to either side over which the shift of a street to the middle of its passes is
/// averaged, metres.
const SHIFT_M: f64 = 20.0;
/// A path that turns by more than the angle (radians) within the distance (metres) takes another
/// street.
const TURN: (f64, f64) = (0.9, 24.0);

/// A point of the driven path.
#[derive(Clone, Copy, Debug)]
pub struct Waypoint {
    /// The position of the vehicle.
    pub vehicle: Point2<f64>,
    /// The centre of its street, given its lane.
    pub centre: Point2<f64>,
    /// The driving direction, a unit vector.
    pub ahead: Vector2<f64>,
    /// The time, seconds.
    pub time_s: f64,
}

/// Samples a path every two metres.
pub fn waypoints(path: &dyn Path, duration_s: f64, driving_side: DrivingSide) -> Vec<Waypoint> {
    let poses = steps(path, duration_s);
    let to_centre = match driving_side {
        DrivingSide::Left => -LANE_M / 2.0,
        DrivingSide::Right => LANE_M / 2.0,
    };
    let point = |index: usize| {
        let (time_s, pose) = poses[index];
        let ahead = direction(&poses, index);
        let vehicle = Point2::from(pose.translation.vector);
        let centre = vehicle + Vector2::new(-ahead.y, ahead.x) * to_centre;
        Waypoint {
            vehicle,
            centre,
            ahead,
            time_s,
        }
    };
    (0..poses.len()).map(point).collect()
}

/// Poses with their times, some metres apart; at least two, the last of which lies ahead of the
/// path's end.
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

/// The direction of the path; the vehicle's own where the path is not along it, as when it turns on
/// the spot.
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

/// Centre lines of the streets of all drives, each once.
pub fn driven_lines(drives: &[Vec<Waypoint>]) -> Vec<Line> {
    let mut merger = Merger::default();
    for waypoints in drives {
        for point in waypoints {
            merger.add(point);
        }
        merger.end_drive();
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
    /// The passes beside each point of each line: minimum and maximum offset, metres to the left.
    spans: Vec<Vec<[f64; 2]>>,
    grid: LineGrid,
    /// True if the last line is being continued.
    drawing: bool,
    /// The last place on an existing street.
    joined: Option<Point2<f64>>,
}

impl Merger {
    fn add(&mut self, point: &Waypoint) {
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

    fn draw(&mut self, point: &Waypoint) {
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

    /// The next waypoint does not continue the street of the last.
    fn end_drive(&mut self) {
        self.drawing = false;
        self.joined = None;
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

    /// The lines, each shifted to the middle of its passes.
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
        // The ends stay, since other lines begin there.
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

/// Cuts a line in the middle of each sharp turn.
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
