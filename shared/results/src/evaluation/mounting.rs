//! A constant difference of headings: estimate and ground truth are of sensors that are mounted
//! otherwise.

use gyre_geometry::Pose;
use nalgebra::Complex;

use crate::evaluation::MatchedPoses;

/// A smaller difference may be an error of the headings, rad.
const MIN_OFFSET_RAD: f64 = 0.25;
/// The least mean of the unit vectors of the differences, which is 1 if all are the same. With a
/// standard deviation of 8 degrees it is 0.99.
const MIN_AGREEMENT: f64 = 0.99;

/// Returns the heading of the estimate minus the heading of the ground truth, rad, where all
/// headings differ by the same large angle once the positions are aligned.
pub(crate) fn heading_offset_rad(
    matched: &MatchedPoses,
    truth_from_estimate: &Pose,
) -> Option<f64> {
    let difference = |(estimate, truth): (&Pose, &Pose)| {
        let aligned = truth_from_estimate.rotation * estimate.rotation;
        (aligned * truth.rotation.inverse()).into_inner()
    };
    let sum: Complex<f64> = matched.iter().map(difference).sum();
    let mean = sum / matched.len() as f64;
    let (agreement, offset_rad) = mean.to_polar();
    (agreement > MIN_AGREEMENT && offset_rad.abs() > MIN_OFFSET_RAD).then_some(offset_rad)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::evaluation::{ate::align, handedness::tests::drive};

    #[test]
    fn a_sensor_that_is_mounted_otherwise_is_found() {
        let found = |turned: &dyn Fn(usize) -> f64| {
            let turn = |(k, p): (usize, Pose)| p * Pose::rotation(turned(k));
            let estimate = drive().into_iter().enumerate().map(turn).collect();
            let matched = MatchedPoses::new(estimate, drive());
            heading_offset_rad(&matched, &align(&matched))
        };
        for offset in [-1.5, 0.3, 3.1] {
            let offset_rad = found(&|_| offset).unwrap();
            assert!((offset_rad - offset).abs() < 1e-9, "{offset_rad}");
        }
        assert_eq!(found(&|_| 0.05), None);
        assert_eq!(found(&|k| 0.02 * k as f64), None);
    }
}
