//! Covariances of chosen poses, by solving with the sparse factor.

use gyre_geometry::UncertainMotion;
use nalgebra::Matrix3;

use super::{PoseGraph, system::System};
use crate::estimation::{EstimationError, constraint::keyframe_exists, relative::Relative};

impl PoseGraph {
    /// Returns the pose of a keyframe with its covariance along the axes of the frame of the poses:
    /// exact after [`PoseGraph::solve`], and dead reckoning for keyframes added since. The first
    /// call after a change factorises the equations.
    pub fn pose(&mut self, keyframe: usize) -> Result<UncertainMotion, EstimationError> {
        keyframe_exists(keyframe, self.state.poses.len())?;
        let covariance = self.project(&[(keyframe, Matrix3::identity())])?;
        Ok(UncertainMotion {
            motion: self.state.poses[keyframe],
            covariance,
        })
    }

    /// Predicts the pose of keyframe `to` in the frame of `from`, with its covariance: the initial
    /// guess of their registration (Checchin et al., Eq. 4).
    pub fn predict(&mut self, from: usize, to: usize) -> Result<UncertainMotion, EstimationError> {
        keyframe_exists(from.max(to), self.state.poses.len())?;
        let relative = Relative::predict(&self.state.poses[from], &self.state.poses[to]);
        let covariance = self.project(&[(from, relative.by_from), (to, relative.by_to)])?;
        Ok(UncertainMotion {
            motion: relative.motion,
            covariance,
        })
    }

    /// Returns the covariance of the sum of poses times their Jacobians: J inv(H) J'.
    pub(super) fn project(
        &mut self,
        jacobians: &[(usize, Matrix3<f64>)],
    ) -> Result<Matrix3<f64>, EstimationError> {
        let system = self.factorised()?;
        let rows = |&(keyframe, jacobian): &(usize, Matrix3<f64>)| {
            System::row(keyframe).map(|row| (row, jacobian))
        };
        let jacobians: Vec<_> = jacobians.iter().filter_map(rows).collect();
        let mut covariance = Matrix3::zeros();
        for axis in 0..3 {
            let mut side = system.right_hand_side();
            for (row, jacobian) in &jacobians {
                let mut side = side.fixed_rows_mut::<3>(*row);
                side += jacobian.row(axis).transpose();
            }
            system.solve(&mut side);
            for (row, jacobian) in &jacobians {
                let mut column = covariance.column_mut(axis);
                column += jacobian * side.fixed_rows::<3>(*row);
            }
        }
        Ok(0.5 * (covariance + covariance.transpose()))
    }
}
