//! The register of lots, which keeps them from overlapping.

use std::collections::BTreeMap;

use gyre_geometry::Pose;
use nalgebra::{Point2, Vector2};

use crate::streets::Streets;

/// Side of a cell of the register, metres.
const CELL_M: f64 = 24.0;
/// Permitted overlap of neighbours, metres, for rounding.
const TOLERANCE_M: f64 = 0.02;
/// Distance between the places of a lot that are checked against the streets, metres: less than the
/// width of any street.
const SAMPLE_M: f64 = 3.0;

/// A rectangle of land beside a street.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Lot {
    /// The pose of its corner on the street: x along its front, y away from the street.
    pub pose: Pose,
    /// Width along the front, metres.
    pub width_m: f64,
    /// Length of the street that it takes, metres: more than its width on the inside of bends.
    pub frontage_m: f64,
    /// Depth away from the street, metres.
    pub depth_m: f64,
}

impl Lot {
    pub(super) fn corners(&self) -> [Point2<f64>; 4] {
        [
            (0.0, 0.0),
            (self.width_m, 0.0),
            (self.width_m, self.depth_m),
            (0.0, self.depth_m),
        ]
        .map(|(x, y)| self.pose * Point2::new(x, y))
    }

    /// Returns whether all of it is at least `metres` from all kerbs.
    pub(super) fn is_clear(&self, streets: &Streets, metres: f64) -> bool {
        let steps = |length_m: f64| (length_m / SAMPLE_M).ceil().max(1.0) as usize;
        let (columns, rows) = (steps(self.width_m), steps(self.depth_m));
        let share = |step: usize, steps: usize| step as f64 / steps as f64;
        (0..=rows).all(|row| {
            (0..=columns).all(|column| {
                let local = Point2::new(
                    self.width_m * share(column, columns),
                    self.depth_m * share(row, rows),
                );
                streets.clearance_m(self.pose * local, metres) >= metres
            })
        })
    }

    /// Returns whether the two overlap: no side of either separates them.
    pub(super) fn overlaps(&self, other: &Self) -> bool {
        let (ours, theirs) = (self.corners(), other.corners());
        [self, other].into_iter().all(|lot| {
            [Vector2::x(), Vector2::y()].into_iter().all(|axis| {
                let axis = lot.pose * axis;
                let [a, b] = [&ours, &theirs].map(|corners| {
                    let shadow = corners.map(|corner| corner.coords.dot(&axis));
                    (
                        shadow.into_iter().fold(f64::MAX, f64::min),
                        shadow.into_iter().fold(f64::MIN, f64::max),
                    )
                });
                a.1 > b.0 + TOLERANCE_M && b.1 > a.0 + TOLERANCE_M
            })
        })
    }
}

/// All lots that are taken.
#[derive(Default)]
pub(super) struct Register {
    lots: Vec<Lot>,
    cells: BTreeMap<(i32, i32), Vec<u32>>,
}

impl Register {
    /// Takes a lot, if all of it is free.
    pub(super) fn take(&mut self, lot: &Lot) -> bool {
        let taken = |number: &u32| self.lots[*number as usize].overlaps(lot);
        if cells(lot).any(|cell| {
            self.cells
                .get(&cell)
                .is_some_and(|there| there.iter().any(taken))
        }) {
            return false;
        }
        for cell in cells(lot) {
            self.cells
                .entry(cell)
                .or_default()
                .push(self.lots.len() as u32);
        }
        self.lots.push(*lot);
        true
    }

    #[cfg(test)]
    pub(super) fn lots(&self) -> &[Lot] {
        &self.lots
    }
}

/// The cells that a lot may touch.
fn cells(lot: &Lot) -> impl Iterator<Item = (i32, i32)> {
    let corners = lot.corners();
    let low = corners.iter().skip(1).fold(corners[0], |a, b| a.inf(b)) / CELL_M;
    let high = corners.iter().skip(1).fold(corners[0], |a, b| a.sup(b)) / CELL_M;
    let columns = low.x.floor() as i32..=high.x.floor() as i32;
    columns.flat_map(move |column| {
        (low.y.floor() as i32..=high.y.floor() as i32).map(move |row| (column, row))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn lot(x: f64, y: f64, turn: f64) -> Lot {
        Lot {
            pose: gyre_geometry::pose(x, y, turn),
            width_m: 10.0,
            frontage_m: 10.0,
            depth_m: 30.0,
        }
    }

    #[test]
    fn land_is_taken_once_and_neighbours_may_touch() {
        let mut register = Register::default();
        assert!(register.take(&lot(0.0, 0.0, 0.0)));
        assert!(!register.take(&lot(5.0, 5.0, 0.7)));
        assert!(!register.take(&lot(0.0, 0.0, 0.0)));
        assert!(register.take(&lot(10.0, 0.0, 0.0)), "it shares a side");
        assert!(
            register.take(&lot(24.0, 27.0, 0.8)),
            "it lies askew behind the second"
        );
        assert_eq!(register.lots().len(), 3);
    }
}
