//! The lever arm of the antenna, by the fixes of a drive that turns.

use gyre_slam::estimation::{Position, align};
use gyre_geometry::Pose;
use nalgebra::{Matrix2, SMatrix, SVector, Vector2};

/// Gauss-Newton steps: the problem is linear but for the heading of the frame, which `align` knows.
const STEPS: usize = 8;
/// Blocks of the drive that the jackknife leaves out one by one.
const BLOCKS: usize = 12;

/// A lever arm with its standard deviations, m.
#[derive(Clone, Copy, Debug)]
pub struct Lever {
    pub forward_left_m: Vector2<f64>,
    pub sigma_m: Vector2<f64>,
}

/// Fits what is to be added to the lever arm that the positions have, together with the pose of the
/// poses' frame, by least squares; `None` where the drive does not tell it.
pub fn fit(poses: &[Pose], positions: &[Position]) -> Option<Vector2<f64>> {
    let mut frame = align(poses, positions)?;
    let mut lever = Vector2::zeros();
    for _ in 0..STEPS {
        let mut matrix = SMatrix::<f64, 5, 5>::zeros();
        let mut side = SVector::<f64, 5>::zeros();
        for it in positions {
            let pose = &poses[it.keyframe];
            let at = pose.translation.vector + pose.rotation * (it.lever_m + lever);
            let turned = frame.rotation * at;
            let residual = it.position_m - turned - frame.translation.vector;
            let by_lever = (frame.rotation * pose.rotation)
                .to_rotation_matrix()
                .into_inner();
            let mut jacobian = SMatrix::<f64, 2, 5>::zeros();
            jacobian
                .fixed_view_mut::<2, 2>(0, 0)
                .copy_from(&Matrix2::identity());
            jacobian
                .column_mut(2)
                .copy_from(&Vector2::new(-turned.y, turned.x));
            jacobian.fixed_view_mut::<2, 2>(0, 3).copy_from(&by_lever);
            matrix += jacobian.transpose() * jacobian / it.variance_m2;
            side += jacobian.transpose() * residual / it.variance_m2;
        }
        let step = matrix.cholesky()?.solve(&side);
        let yaw_rad = frame.rotation.angle() + step[2];
        frame = Pose::new(frame.translation.vector + step.fixed_rows::<2>(0), yaw_rad);
        lever += step.fixed_rows::<2>(3);
    }
    Some(lever)
}

/// Fits it with standard deviations, those of the jackknife over blocks of the drive.
pub fn fit_with_sigma(poses: &[Pose], positions: &[Position]) -> Option<Lever> {
    let block = |k: usize| k * BLOCKS / positions.len();
    let without = |left_out: usize| {
        let kept = positions.iter().enumerate();
        let kept = kept.filter(|(k, _)| block(*k) != left_out);
        let kept: Vec<Position> = kept.map(|(_, it)| *it).collect();
        fit(poses, &kept)
    };
    let levers: Vec<Vector2<f64>> = (0..BLOCKS).map(without).collect::<Option<_>>()?;
    let mean = levers.iter().sum::<Vector2<f64>>() / BLOCKS as f64;
    let squares = levers
        .iter()
        .map(|lever| (lever - mean).component_mul(&(lever - mean)));
    let spread: Vector2<f64> = squares.sum();
    Some(Lever {
        forward_left_m: fit(poses, positions)?,
        sigma_m: (spread * (BLOCKS - 1) as f64 / BLOCKS as f64).map(f64::sqrt),
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use gyre_geometry::pose;
    use nalgebra::Point2;

    use super::*;

    #[test]
    fn the_lever_of_a_drive_that_turns_is_found() {
        let (frame, lever) = (pose(40.0, -9.0, 2.0), Vector2::new(0.4, -1.2));
        let mut poses = vec![Pose::identity()];
        for k in 1..200 {
            let turn = 0.05 * (k as f64 / 15.0).sin();
            poses.push(poses[k - 1] * pose(2.0, 0.0, turn));
        }
        let positions: Vec<Position> = poses
            .iter()
            .enumerate()
            .map(|(keyframe, at)| Position {
                keyframe,
                lever_m: Vector2::zeros(),
                position_m: (frame * at * Point2::from(lever)).coords,
                variance_m2: 1.0,
                share: 1.0,
            })
            .collect();
        let found = fit_with_sigma(&poses, &positions).unwrap();
        assert!((found.forward_left_m - lever).norm() < 1e-6);
        assert!(found.sigma_m.norm() < 1e-6);
    }
}
