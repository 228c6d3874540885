//! Properties of the metrics for random drives.

use std::num::NonZeroUsize;

use crate::common::{any_drive, any_pose, by_index, chain, drive};
use gyre_geometry::{Pose, pose};
use gyre_results::evaluation::{MatchedPoses, SEGMENT_LENGTHS_M, ate, kitti, rpe, seg};
use proptest::prelude::*;

/// The rounding error of an arc cosine near 1, degrees: the square root of some hundred ulps.
const ARC_COSINE_DEG: f64 = 3e-5;

fn step(step: usize) -> NonZeroUsize {
    NonZeroUsize::new(step).unwrap()
}

fn matched(estimate: &[Pose], truth: &[Pose]) -> MatchedPoses {
    MatchedPoses::new(estimate.to_vec(), truth.to_vec())
}

/// Chains the motions from pose to pose after `change`.
fn rechained(poses: &[Pose], change: impl Fn(usize, Pose) -> Pose) -> Vec<Pose> {
    let pairs = poses.windows(2).enumerate();
    let motions = pairs.map(|(k, w)| change(k, w[0].inv_mul(&w[1])));
    chain(poses[0], motions.collect::<Vec<_>>())
}

/// The KITTI errors by their definition: a linear search for each end, and 3 x 3 matrices. Returns
/// translation (%), rotation (deg/100 m) and the number of segments.
fn kitti_by_definition(estimate: &[Pose], truth: &[Pose], step: usize) -> (f64, f64, usize) {
    let (mut translation, mut rotation, mut n) = (0.0, 0.0, 0);
    for first in (0..truth.len()).step_by(step) {
        for length in SEGMENT_LENGTHS_M {
            let (mut travelled, mut last) = (0.0, first);
            while travelled <= length && last + 1 < truth.len() {
                travelled +=
                    (truth[last + 1].translation.vector - truth[last].translation.vector).norm();
                last += 1;
            }
            if travelled <= length {
                continue;
            }
            let motion = |p: &[Pose]| {
                p[first].to_homogeneous().try_inverse().unwrap() * p[last].to_homogeneous()
            };
            let error = motion(estimate).try_inverse().unwrap() * motion(truth);
            translation += error[(0, 2)].hypot(error[(1, 2)]) / length;
            rotation += error[(1, 0)].atan2(error[(0, 0)]).abs() / length;
            n += 1;
        }
    }
    let mean = |sum: f64| 100.0 * sum / n as f64;
    (mean(translation), mean(rotation.to_degrees()), n)
}

proptest! {
    #![proptest_config(ProptestConfig { failure_persistence: None, ..ProptestConfig::with_cases(48) })]

    #[test]
    fn a_copy_in_another_frame_has_no_error((n, bend) in any_drive(), moved_by in any_pose()) {
        let truth = drive(n, bend);
        let estimate: Vec<_> = truth.iter().map(|p| moved_by * p).collect();
        let m = matched(&estimate, &truth);
        prop_assert!(ate(&m).max_m < 1e-8);
        let round_trip = ate(&m).truth_from_estimate * moved_by;
        prop_assert!(round_trip.translation.vector.norm() < 1e-7);
        prop_assert!(round_trip.rotation.angle().abs() < 1e-10);
        prop_assert!(seg(&m, step(5)).unwrap().percent < 1e-8);
        let (kitti, rpe) = (kitti(&m, step(5)).unwrap(), rpe(&m));
        prop_assert!(kitti.translation_percent < 1e-8 && kitti.rotation_deg_per_100m < ARC_COSINE_DEG);
        prop_assert!(rpe.translation_rmse_m < 1e-8 && rpe.rotation_rmse_deg < 1e-8);
    }

    #[test]
    fn no_nearby_rigid_motion_aligns_better((n, bend) in any_drive(), by in any_pose(), dx in -0.5..0.5, dy in -0.5..0.5, turn in -0.02..0.02) {
        let truth = drive(n, bend);
        let estimate: Vec<_> = truth.iter().enumerate()
            .map(|(k, p)| by * pose((k as f64).sin(), (3.0 * k as f64).cos(), 0.0) * p).collect();
        let m = matched(&estimate, &truth);
        let best = ate(&m);
        let other = pose(dx, dy, turn) * best.truth_from_estimate;
        let square = |(e, t): (&Pose, &Pose)| ((other * e).translation.vector - t.translation.vector).norm_squared();
        let rmse = (m.iter().map(square).sum::<f64>() / m.len() as f64).sqrt();
        prop_assert!(rmse >= best.rmse_m - 1e-9);
    }

    #[test]
    fn kitti_errors_equal_their_definition((n, bend) in any_drive(), every in 1usize..12, scale in 0.95..1.05, bias in -0.002..0.002) {
        let truth = drive(n, bend);
        let estimate = rechained(&truth, |k, m| pose(
            scale * m.translation.x, 0.1 * (k as f64).sin(), m.rotation.angle() + bias));
        let fast = kitti(&matched(&estimate, &truth), step(every)).unwrap();
        let (translation, rotation, segments) = kitti_by_definition(&estimate, &truth, every);
        prop_assert!((fast.translation_percent - translation).abs() < 1e-8);
        prop_assert!((fast.rotation_deg_per_100m - rotation).abs() < ARC_COSINE_DEG);
        prop_assert_eq!(fast.segments, segments);
        let weighted = |value: fn(&kitti::KittiLength) -> f64| fast.by_length.iter()
            .map(|l| value(l) * l.segments as f64).sum::<f64>() / fast.segments as f64;
        prop_assert!((weighted(|l| l.translation_percent) - translation).abs() < 1e-8);
        prop_assert!((weighted(|l| l.rotation_deg_per_100m) - rotation).abs() < ARC_COSINE_DEG);
    }

    #[test]
    fn seg_and_ate_do_not_depend_on_headings((n, bend) in any_drive(), bias in -3.0..3.0) {
        let truth = drive(n, bend);
        let noisy = rechained(&truth, |k, m| m * Pose::rotation(0.001 * (k as f64).sin()));
        let turned: Vec<_> = noisy.iter().map(|p| p * Pose::rotation(bias)).collect();
        let (a, b) = (matched(&noisy, &truth), matched(&turned, &truth));
        prop_assert_eq!(seg(&a, step(7)), seg(&b, step(7)));
        prop_assert_eq!(ate(&a), ate(&b));
    }
}

#[test]
fn a_path_below_100_m_has_no_kitti_errors_but_rpe() {
    let truth = drive(30, 50.0);
    let estimate = rechained(&truth, |_, m| m * pose(0.1, 0.0, 0.0));
    let evaluation = by_index(&estimate, &truth, 10);
    assert!(evaluation.kitti.is_none() && evaluation.seg.is_none());
    let rpe = evaluation.rpe.as_ref().unwrap();
    assert!((rpe.translation_rmse_m - 0.1).abs() < 1e-9);
    assert!((rpe.forward_ratio.unwrap() - 2.47 / 2.37).abs() < 1e-4);
    let table = evaluation.to_string();
    for words in [
        "the path is not longer than 100 m; use RPE",
        "translation 0.1000 m rmse",
    ] {
        assert!(table.contains(words), "{table}");
    }
}
