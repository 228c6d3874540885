//! The plan of a town: junctions on an uneven grid, streets between most neighbours.

use std::f64::consts::PI;

use nalgebra::{Point2, Vector2};
use rand::Rng;

/// Distance between parallel streets, metres.
const SPACING_M: std::ops::Range<f64> = 76.0..130.0;
/// Maximum offset of a junction from its place on the grid, metres in x and y.
const JITTER_M: f64 = 6.0;
/// Maximum offset of a street from the straight line between its junctions, metres.
const SWERVE_M: f64 = 5.0;
/// Share of the streets that are left out.
const MISSING: f64 = 0.15;
/// Speed limits of main, ordinary and narrow streets, as shares of the highest.
const LIMITS: [f64; 3] = [1.0, 0.8, 0.62];

/// Junctions and the streets between them.
#[derive(Debug)]
pub struct Plan {
    pub junctions: Vec<Point2<f64>>,
    /// The neighbours of each junction, ascending.
    pub neighbours: Vec<Vec<usize>>,
    columns: usize,
    swerves_m: Vec<[f64; 2]>,
    limits: [Vec<f64>; 2],
}

impl Plan {
    /// Draws a town that is large enough for a drive of `length_m`.
    pub fn new(length_m: f64, rng: &mut impl Rng) -> Self {
        let side = ((length_m / 250.0).sqrt().ceil() as usize).clamp(3, 60) + 2;
        let [xs, ys] = [0, 1].map(|_| grid_lines(side, rng));
        let mut jitter = || rng.random_range(-JITTER_M..JITTER_M);
        let place = |index: usize| Point2::new(xs[index % side], ys[index / side]);
        let junctions: Vec<_> = (0..side * side)
            .map(|i| place(i) + Vector2::new(jitter(), jitter()))
            .collect();
        let swerve = |_| [0, 1].map(|_| rng.random_range(-SWERVE_M..SWERVE_M));
        let swerves_m = (0..side * side).map(swerve).collect();
        let mut limit = || LIMITS[rng.random_range(0..LIMITS.len())];
        let limits = [0, 1].map(|_| (0..side).map(|_| limit()).collect());
        let mut plan = Self {
            junctions,
            neighbours: vec![Vec::new(); side * side],
            columns: side,
            swerves_m,
            limits,
        };
        plan.connect();
        plan.remove_some(rng);
        plan
    }

    fn connect(&mut self) {
        let side = self.columns;
        for index in 0..side * side {
            let (column, row) = (index % side, index / side);
            let directions = [
                (row > 0, -(side as isize)),
                (column > 0, -1),
                (column + 1 < side, 1),
                (row + 1 < side, side as isize),
            ];
            let built = directions.into_iter().filter(|(there, _)| *there);
            self.neighbours[index] = built
                .map(|(_, step)| index.wrapping_add_signed(step))
                .collect();
        }
    }

    /// Removes streets between junctions that keep three others, so that no junction becomes a dead
    /// end or a bend.
    fn remove_some(&mut self, rng: &mut impl Rng) {
        for from in 0..self.junctions.len() {
            for to in self.neighbours[from].clone() {
                let spare =
                    from < to && self.neighbours[from].len() > 3 && self.neighbours[to].len() > 3;
                if spare && rng.random_bool(MISSING) {
                    self.neighbours[from].retain(|n| *n != to);
                    self.neighbours[to].retain(|n| *n != from);
                }
            }
        }
    }

    /// Place and direction on the centre line between two junctions; `share` is 0 at `from`, 1 at
    /// `to`.
    pub fn street(&self, from: usize, to: usize, share: f64) -> (Point2<f64>, Vector2<f64>) {
        let (low, high) = (from.min(to), from.max(to));
        let swerve_m = self.swerves_m[low][usize::from(high - low == 1)];
        let line = self.junctions[to] - self.junctions[from];
        let side = Vector2::new(-line.y, line.x).normalize()
            * if from < to { swerve_m } else { -swerve_m };
        // A squared sine leaves both junctions in the direction of the straight line between them.
        let place = self.junctions[from] + line * share + side * (PI * share).sin().powi(2);
        (
            place,
            (line + side * (PI * (2.0 * PI * share).sin())).normalize(),
        )
    }

    /// Length of the straight line between two junctions, metres.
    pub fn distance_m(&self, from: usize, to: usize) -> f64 {
        (self.junctions[to] - self.junctions[from]).norm()
    }

    /// Speed limit between two junctions, as a share of the highest.
    pub fn limit(&self, from: usize, to: usize) -> f64 {
        let (low, high) = (from.min(to), from.max(to));
        if high - low == 1 {
            self.limits[0][low / self.columns]
        } else {
            self.limits[1][low % self.columns]
        }
    }
}

/// Coordinates of parallel streets.
fn grid_lines(count: usize, rng: &mut impl Rng) -> Vec<f64> {
    let mut at = 0.0;
    let mut lines = Vec::with_capacity(count);
    for _ in 0..count {
        lines.push(at);
        at += rng.random_range(SPACING_M);
    }
    lines
}
