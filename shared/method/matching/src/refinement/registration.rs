//! Registration of the points of a scan with the map, from an initial guess.

use gyre_geometry::{Pose, SparsePoint, Twist};
use nalgebra::UnitVector2;

use super::{
    alignment::{Alignment, align},
    local_map::LocalMap,
    points::DeskewedPoints,
};

const COARSE_ITERATIONS: usize = 10;
const FINE_ITERATIONS: usize = 6;
/// On the coarse map every third point is enough.
pub(super) const COARSE_STRIDE: usize = 3;
/// Times that the points are deskewed by the newest motion and aligned on the fine map.
const FINE_ROUNDS: usize = 2;

pub(super) struct Registration<'a, F> {
    pub map: &'a LocalMap,
    pub scan: &'a [SparsePoint],
    /// The velocity during the sweep of the scan, if this is its pose.
    pub twist_to: F,
    /// Memory for the deskewed points: afterwards the points of the last alignment.
    pub points: &'a mut DeskewedPoints,
}

impl<F: Fn(&Pose) -> Twist> Registration<'_, F> {
    pub fn deskew(&mut self, pose: &Pose) {
        self.points.deskew(self.scan, &(self.twist_to)(pose));
    }

    /// Aligns some of the points with the coarse map. A `locked` direction along the map's axes
    /// keeps its place.
    pub fn align_coarse(&mut self, initial: &Pose, locked: Option<UnitVector2<f64>>) -> Alignment {
        self.deskew(initial);
        self.points.thin(COARSE_STRIDE);
        let (map, points) = (self.map.coarse(), &*self.points);
        align(&map, points, initial, COARSE_ITERATIONS, locked)
    }

    /// Aligns the points with the fine map, from a pose that is aligned with the coarse one.
    pub fn align_fine(&mut self, coarse: Pose, locked: Option<UnitVector2<f64>>) -> Alignment {
        let mut fine = |pose: &Pose| {
            self.deskew(pose);
            align(&self.map.fine(), self.points, pose, FINE_ITERATIONS, locked)
        };
        let mut pose = coarse;
        for _ in 1..FINE_ROUNDS {
            pose = fine(&pose).pose;
        }
        fine(&pose)
    }
}
