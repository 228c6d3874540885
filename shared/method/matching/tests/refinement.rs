//! The refined trajectory of generated drives follows the true one.
//!
//! Bounds are about twice the worst that was measured over a few scenes.

use crate::common::scenes::*;
use gyre_geometry::{Pose, SparsePoint, mirrored, samples::AllEvidence};
use gyre_matching::{Outcome, TrackerState};
use nalgebra::Vector2;

/// The area visible along [`straight`].
const AROUND: [[f64; 2]; 2] = [[-120.0, 370.0], [-100.0, 100.0]];
const SEEDS: [u64; 3] = [1, 11, 21];

/// 250 m at 10 m/s.
fn straight() -> Drive {
    Drive::steady(10.0, 0.0, 101)
}

fn all_refined(run: &Run) -> bool {
    run.refined
        .iter()
        .all(|refined| refined.outcome == Outcome::Refined)
}

#[track_caller]
fn follows(name: &str, run: &Run, yaw_deg: f64, shift_m: f64, worst_deg: f64, worst_m: f64) {
    let errors = run.errors();
    assert!(all_refined(run), "{name}");
    let is_near = errors.yaw_deg.abs() < yaw_deg && errors.shift_m < shift_m;
    let is_even = errors.worst_deg < worst_deg && errors.worst_m < worst_m;
    assert!(is_near && is_even, "{name}: {errors:.3?}");
}

#[test]
fn straight_drives_are_followed() {
    for seed in SEEDS {
        let run = run(&town(AROUND, seed), &straight(), &NOISY);
        follows("straight", &run, 0.1, 0.5, 0.06, 0.1);
    }
}

#[test]
fn turns_to_either_side_are_followed() {
    for seed in SEEDS {
        let scene = town([[-150.0, 150.0]; 2], seed);
        for (name, rate) in [("left turn", 20.0), ("right turn", -20.0)] {
            let run = run(&scene, &Drive::steady(8.0, rate, 101), &NOISY);
            follows(name, &run, 0.25, 0.25, 0.08, 0.12);
        }
    }
}

/// A town on one side of [`straight`].
fn one_sided(seed: u64) -> Vec<Reflector> {
    town([AROUND[0], [6.0, 100.0]], seed)
}

#[test]
fn yaw_drifts_little_with_structure_on_one_side_only() {
    let mut sums_deg = [0.0; 2];
    let flip = |v: Vector2<f64>| Vector2::new(v.x, -v.y);
    for seed in SEEDS {
        let left = one_sided(seed);
        let right = left.iter().map(|it| Reflector {
            from: flip(it.from),
            along: flip(it.along),
            ..*it
        });
        let right = right.collect();
        for (sum_deg, scene) in sums_deg.iter_mut().zip([left, right]) {
            let run = run(&scene, &straight(), &NOISY);
            follows("one side", &run, 0.55, 1.9, 0.3, 0.4);
            *sum_deg += run.errors().yaw_deg;
        }
    }
    // Per 100 m in the mean of three drives of 250 m.
    let drifts_deg = sums_deg.map(|sum_deg| sum_deg / 3.0 / 2.5);
    assert!(
        drifts_deg.iter().all(|drift| drift.abs() < 0.18),
        "{drifts_deg:?}"
    );
}

#[test]
fn mirrored_points_give_the_mirrored_motion() {
    let drive = Drive::steady(10.0, 5.0, 41);
    let (mut apart, mut sums_deg) = (Vec::new(), Vec::new());
    for seed in 1..6 {
        let scans = scans(&one_sided(seed), &drive, &NOISY);
        let flip = |p: &SparsePoint| SparsePoint { y_m: -p.y_m, ..*p };
        let flip_all = |scan: &Vec<SparsePoint>| scan.iter().map(flip).collect();
        let flipped: Vec<Vec<SparsePoint>> = scans.iter().map(flip_all).collect();
        let search = |k: usize| searched(&drive, k - 1);
        let one = refine_aided(&mut refiner(), &scans, |_| AllEvidence::default(), search);
        let search = |k: usize| mirrored(&searched(&drive, k - 1));
        let other = refine_aided(&mut refiner(), &flipped, |_| AllEvidence::default(), search);
        let [one, other] = [one, other].map(|refined| {
            let driven = |count| {
                let motions = refined[..count].iter().map(|it| it.motion.motion);
                motions.fold(Pose::identity(), |at, motion| at * motion)
            };
            [driven(5), driven(40)]
        });
        let between = one[0].inv_mul(&mirrored(&other[0]));
        let turned = between.rotation.angle().abs();
        apart.push(between.translation.vector.norm() + 50.0 * turned);
        sums_deg.push((one[1].rotation.angle() + other[1].rotation.angle()).to_degrees());
    }
    apart.sort_by(f64::total_cmp);
    let mean_deg = sums_deg.iter().sum::<f64>() / 5.0;
    // They differ by rounding alone: it ends an alignment one step sooner or later (1 mm, 1 mm at
    // 50 m). The difference grows, in some scenes sooner, as any error of the points does.
    assert!(apart[2] < 0.05, "{apart:?}");
    assert!(mean_deg.abs() < 0.15, "{sums_deg:?}");
}

/// From standing to 20 m/s.
fn speeding() -> Drive {
    Drive {
        speed_mps: 0.0,
        acceleration_mps2: 2.0,
        yaw_rate_radps: 0.0,
        scans: 41,
    }
}

#[test]
fn a_reported_doppler_shift_is_compensated() {
    const SHIFTED: Sensor = Sensor {
        doppler_s: 0.05,
        ..NOISY
    };
    for (seed, drive) in SEEDS
        .into_iter()
        .flat_map(|seed| [(seed, straight()), (seed, speeding())])
    {
        let scene = town(AROUND, seed);
        let [reported, without] =
            [SHIFTED, NOISY].map(|sensor| run(&scene, &drive, &sensor).errors());
        let apart_m = (reported.shift_m - without.shift_m).abs();
        let apart_deg = (reported.yaw_deg - without.yaw_deg).abs();
        assert!(apart_m < 0.3 && apart_deg < 0.1, "{reported:?} {without:?}");
    }
}

/// A mask may lower the weights of all points alike.
#[test]
fn a_factor_on_all_weights_changes_neither_motions_nor_covariances() {
    let drive = straight();
    let whole = scans(&town(AROUND, 1), &drive, &NOISY);
    let mut lighter = whole.clone();
    let points = lighter.iter_mut().flatten();
    points.for_each(|point| point.weight *= 0.25);
    let [whole, lighter] =
        [whole, lighter].map(|scans| refine_on(&mut refiner(), &drive, &scans, 0..20));
    for (a, b) in whole.iter().zip(&lighter) {
        let (a, b) = (a.motion, b.motion);
        let apart_m = (a.motion.translation.vector - b.motion.translation.vector).norm();
        let apart = (a.covariance - b.covariance).norm() / a.covariance.norm();
        assert!(apart_m < 1e-3 && apart < 0.01, "{apart_m} m, {apart}");
    }
}

/// A corridor of hedges a metre deep. Points on top of their own image, such as points of walls
/// without depth, have no gradient, so the information matrix of such a corridor would be wrong.
#[test]
fn a_corridor_leaves_its_axis_uncertain() {
    let side = |y: f64| {
        (0..4)
            .map(move |k| y + f64::from(k) / 3.0)
            .map(|y| wall([-110.0, y], [130.0, y], 75))
    };
    let mut scene: Vec<Reflector> = side(9.0).chain(side(-10.0)).collect();
    scene.extend(posts([[-110.0, 130.0], [-9.0, 9.0]], 150.0, 1));
    let drive = Drive::steady(2.0, 0.0, 41);
    let scans = scans(&scene, &drive, &NOISY);
    for yaw in [0.0, 0.5, std::f64::consts::FRAC_PI_2] {
        // The covariance is in the vehicle's frame: the direction of the corridor in the map does
        // not matter.
        let mut refiner = refiner();
        refiner.restore(
            TrackerState {
                pose: Pose::rotation(yaw),
                ..TrackerState::default()
            },
            |_| false,
        );
        let refined = refine_on(&mut refiner, &drive, &scans, 0..40);
        let [along_m2, across_m2] = [0, 1].map(|k| {
            let variances = refined.iter().map(|it| it.motion.covariance[(k, k)]);
            variances.sum::<f64>()
        });
        let ratio = (along_m2 / across_m2).sqrt();
        assert!(ratio > 1.3, "towards {yaw} rad: {ratio}");
    }
}
