//! Side streets that branch off the driven streets.

use std::f64::consts::FRAC_PI_2;

use nalgebra::{Point2, Rotation2, Vector2};
use rand::Rng;

use super::lines::{Line, LineGrid, Segment, length_m};

/// Distance between junctions on one side, metres.
const SPACING_M: std::ops::Range<f64> = 60.0..150.0;
/// Length of a side street that nothing shortens, metres.
const LENGTH_M: std::ops::Range<f64> = 60.0..250.0;
/// Minimum length of a side street, metres.
const SHORTEST_M: f64 = 40.0;
/// Share of the junctions with streets on both sides.
const CROSSROADS: f64 = 0.4;
/// Share of the turns of a drive at which the street continues straight on.
const RUN_ON: f64 = 0.7;
/// Minimum length of a street that continues, metres.
const RUN_ON_FROM_M: f64 = 25.0;
/// Maximum deviation from a right angle, radians.
const SKEW_RAD: f64 = 0.2;
/// Maximum curvature of a side street, radians a metre.
const BEND_RAD_M: f64 = 1.0 / 150.0;
/// A street does not continue if another one continues it: a street this far ahead, metres,
const AHEAD_M: f64 = 15.0;
/// within this distance, metres,
const BESIDE_M: f64 = 10.0;
/// and at an angle with at least this cosine.
const PARALLEL: f64 = 0.8;
/// Distance between the points of a side street, metres.
const STEP_M: f64 = 4.0;
/// Minimum distance between streets that do not meet, metres.
const APART_M: f64 = 32.0;
/// Maximum cosine of the angle between streets that meet.
const STEEP: f64 = 0.6;

/// Draws side streets among existing lines.
pub struct SideStreets<'a, R> {
    lines: Vec<Line>,
    grid: LineGrid,
    rng: &'a mut R,
}

/// Draws the side streets of these lines.
pub fn side_lines(driven: &[Line], rng: &mut impl Rng) -> Vec<Line> {
    let mut sides = SideStreets {
        lines: driven.to_vec(),
        grid: LineGrid::default(),
        rng,
    };
    for (number, line) in driven.iter().enumerate() {
        sides.grid.add_line(number, line);
    }
    for line in driven {
        sides.run_on(line);
    }
    for line in driven {
        sides.branch_off(line);
    }
    sides.lines.split_off(driven.len())
}

impl<R: Rng> SideStreets<'_, R> {
    /// Continues both ends of a line straight on if there is room.
    fn run_on(&mut self, line: &[Point2<f64>]) {
        if length_m(line) < RUN_ON_FROM_M {
            return;
        }
        let reversed: Line = line.iter().rev().copied().collect();
        for line in [line, &reversed] {
            let goes_on = self.rng.random_bool(RUN_ON);
            let (end, direction) = (line[line.len() - 1], end_direction(line));
            let parallel = |s: &Segment| s.direction().dot(&direction).abs() > PARALLEL;
            if goes_on
                && !self
                    .grid
                    .near(end + direction * AHEAD_M, BESIDE_M)
                    .any(parallel)
            {
                self.build(end, direction);
            }
        }
    }

    fn branch_off(&mut self, line: &[Point2<f64>]) {
        let whole_m = length_m(line);
        for side in [1.0, -1.0] {
            let mut along_m = self.rng.random_range(SPACING_M) / 2.0;
            while along_m < whole_m - SPACING_M.start / 2.0 {
                if let Some((start, direction)) = at(line, along_m) {
                    self.branch(start, direction, side);
                    if self.rng.random_bool(CROSSROADS) {
                        self.branch(start, direction, -side);
                    }
                }
                along_m += self.rng.random_range(SPACING_M);
            }
        }
    }

    fn branch(&mut self, start: Point2<f64>, along: Vector2<f64>, side: f64) {
        let skew = self.rng.random_range(-SKEW_RAD..SKEW_RAD);
        let direction = Rotation2::new(side * FRAC_PI_2 + skew) * along;
        let stranger = |s: &Segment| {
            s.direction().dot(&along).abs() < 0.9 && s.direction().dot(&direction) > -0.9
        };
        if !self.grid.near(start, APART_M).any(stranger) {
            self.build(start, direction);
        }
    }

    /// Draws a street from `start` as long as there is room, or up to a street that it meets at a
    /// steep angle.
    fn build(&mut self, start: Point2<f64>, direction: Vector2<f64>) {
        let wanted_m = self.rng.random_range(LENGTH_M);
        let bend = Rotation2::new(
            STEP_M * self.rng.random_range(-BEND_RAD_M..BEND_RAD_M) * self.rng.random::<f64>(),
        );
        let (mut line, mut direction) = (vec![start], direction);
        for _ in 0..(wanted_m / STEP_M) as usize {
            let here = line[line.len() - 1] + direction * STEP_M;
            match self.room(start, here, direction) {
                Room::Free => line.push(here),
                Room::Meets(junction) => {
                    line.push(junction);
                    break;
                }
                Room::TooNear => {
                    // Keep the distance to the street that came near.
                    line.truncate(line.len().saturating_sub(2));
                    break;
                }
            }
            direction = bend * direction;
        }
        if length_m(&line) >= SHORTEST_M {
            self.grid.add_line(self.lines.len(), &line);
            self.lines.push(line);
        }
    }

    fn room(&self, start: Point2<f64>, here: Point2<f64>, direction: Vector2<f64>) -> Room {
        let mut room = Room::Free;
        for segment in self.grid.near(here, APART_M) {
            let foot = segment.foot(here);
            if (segment.foot(start) - start).norm() < APART_M
                && (here - start).norm() < 1.2 * APART_M
            {
                continue;
            }
            let ahead = (foot - here).dot(&direction) > 0.0;
            let steep = segment.direction().dot(&direction).abs() < STEEP && ahead;
            if !steep {
                return Room::TooNear;
            }
            if (foot - here).norm() < STEP_M {
                room = Room::Meets(foot);
            }
        }
        room
    }
}

enum Room {
    Free,
    Meets(Point2<f64>),
    TooNear,
}

/// The direction in which a line ends.
fn end_direction(line: &[Point2<f64>]) -> Vector2<f64> {
    let end = line[line.len() - 1];
    // The last metres of a line that was cut at a turn belong to the turn.
    let back = line
        .iter()
        .rev()
        .find(|p| (end - *p).norm() > 14.0)
        .copied()
        .unwrap_or(line[0]);
    let before = line
        .iter()
        .rev()
        .find(|p| (back - *p).norm() > 14.0 && (end - *p).norm() > 14.0)
        .copied();
    let (from, to) = before.map_or((line[0], end), |before| (before, back));
    (to - from).try_normalize(0.0).unwrap_or(Vector2::x())
}

/// Place and direction at a distance along a line.
fn at(line: &[Point2<f64>], along_m: f64) -> Option<(Point2<f64>, Vector2<f64>)> {
    let mut left_m = along_m;
    for ends in line.windows(2) {
        let segment = ends[1] - ends[0];
        let length_m = segment.norm();
        if left_m <= length_m && length_m > 0.0 {
            return Some((ends[0] + segment * (left_m / length_m), segment / length_m));
        }
        left_m -= length_m;
    }
    None
}
