use gyre_geometry::{Pose, UncertainMotion};
use nalgebra::{Matrix3, Vector3};

use crate::estimation::relative::Relative;

pub(super) type Ends = [usize; 2];

#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Edge {
    pub ends: Ends,
    pub motion: UncertainMotion,
    information: Matrix3<f64>,
}

impl Edge {
    pub fn new(ends: Ends, motion: UncertainMotion) -> Option<Self> {
        Some(Self {
            ends,
            motion,
            information: motion.covariance.cholesky()?.inverse(),
        })
    }

    /// Returns the squared normalised difference of the measured motion from that between the
    /// poses.
    pub fn chi_square(&self, poses: &[Pose]) -> f64 {
        let [from, to] = self.ends;
        let innovation = self.motion.error(&poses[from].inv_mul(&poses[to]));
        innovation.dot(&(self.information * innovation))
    }

    pub fn linearise(&self, poses: &[Pose]) -> Linear {
        let [from, to] = self.ends;
        let relative = Relative::predict(&poses[from], &poses[to]);
        let innovation = self.motion.error(&relative.motion);
        let (a, b) = (relative.by_from, relative.by_to);
        let (weighted_a, weighted_b) = (
            a.transpose() * self.information,
            b.transpose() * self.information,
        );
        Linear {
            blocks: [weighted_a * a, weighted_b * b],
            between: weighted_a * b,
            sides: [weighted_a * innovation, weighted_b * innovation],
            chi_square: innovation.dot(&(self.information * innovation)),
        }
    }
}

/// The contribution of an edge to the normal equations.
pub(super) struct Linear {
    pub blocks: [Matrix3<f64>; 2],
    /// The block of the rows of the first pose and the columns of the second.
    pub between: Matrix3<f64>,
    pub sides: [Vector3<f64>; 2],
    pub chi_square: f64,
}
