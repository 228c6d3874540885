//! A radar with a sweep of one second, as K2Pi (Checchin et al., Table 1): a vehicle drives far
//! between two scans, and its velocity changes within one.

use std::f64::consts::TAU;

use crate::common::scenes::{point, posts};
use gyre_geometry::{Pose, SparsePoint, samples::SensorConfigs};
use gyre_matching::{Outcome, Refined, RefinementConfig, Refiner, Searched};
use nalgebra::{Point2, Rotation2, Vector2};

const SWEEP_S: f64 = 1.0;
const SPEED_MPS: f64 = 4.4;
/// Yaw rate in the bend: 28 degrees in a sweep.
const YAW_RATE_RADPS: f64 = -0.49;
/// Start and end of the bend of 112 degrees, s; both are halfway between two stamps.
const BEND_S: [f64; 2] = [8.5, 12.5];
const SCANS: usize = 22;
const RANGE_M: std::ops::Range<f64> = 5.0..70.0;
/// Error of the search: m, m, rad.
const SEARCH_OFF: [f64; 3] = [0.4, -0.3, 0.07];

/// A straight street, a right bend, a straight street.
fn pose(time_s: f64) -> Pose {
    let arc = |time_s: f64, rate: f64| {
        let turn = rate * time_s;
        let half = 0.5 * turn;
        let chord = SPEED_MPS * time_s * if half == 0.0 { 1.0 } else { half.sin() / half };
        Pose::new(Rotation2::new(half) * Vector2::new(chord, 0.0), turn)
    };
    let in_bend_s = time_s.clamp(BEND_S[0], BEND_S[1]) - BEND_S[0];
    arc(time_s.min(BEND_S[0]), 0.0)
        * arc(in_bend_s, YAW_RATE_RADPS)
        * arc((time_s - BEND_S[1]).max(0.0), 0.0)
}

/// The posts as scan `k` sees them, each at the time when the clockwise beam passes it.
fn scan(posts: &[Point2<f64>], k: usize) -> Vec<SparsePoint> {
    let see = |post: &Point2<f64>| {
        let (mut time_s, mut place) = (0.0, Point2::origin());
        for _ in 0..20 {
            place = pose(k as f64 * SWEEP_S + time_s).inverse_transform_point(post);
            time_s = ((-place.y).atan2(place.x).rem_euclid(TAU) / TAU - 0.5) * SWEEP_S;
        }
        RANGE_M
            .contains(&place.coords.norm())
            .then(|| point([place.x, place.y, time_s, 1.0, 0.0]))
    };
    posts.iter().filter_map(see).collect()
}

fn true_motion(k: usize) -> Pose {
    pose((k - 1) as f64 * SWEEP_S).inv_mul(&pose(k as f64 * SWEEP_S))
}

fn refined(seed: u64) -> Vec<Refined> {
    let config = RefinementConfig {
        keyframes: 5,
        cell_m: 0.6,
        acceleration_mps2: 2.0,
        yaw_acceleration_degps2: 35.0,
        firm_overlap: 0.5,
        min_overlap: 0.3,
        reach_m: 80.0,
        ..RefinementConfig::default()
    };
    let mut refiner = Refiner::new(&config, &SensorConfigs::default(), 2048).unwrap();
    let posts: Vec<_> = posts([[-80.0, 130.0], [-120.0, 80.0]], 60.0, seed)
        .iter()
        .map(|p| p.from.into())
        .collect();
    let scans: Vec<_> = (0..SCANS).map(|k| scan(&posts, k)).collect();
    let [x, y, turn] = SEARCH_OFF;
    let next = |k: usize| {
        let searched = true_motion(k) * Pose::new(Vector2::new(x, y), turn);
        refiner.refine(&Searched::by_radar(
            k as u64,
            &scans[k],
            &scans[k - 1],
            &searched,
            SWEEP_S,
        ))
    };
    (1..SCANS).map(next).collect()
}

/// Measured: at most 1.7 degrees, and 0.6 m at the end. If the points are deskewed with the
/// velocity of the scan before, the first scan in the bend matches nothing, and the yaw is 10
/// degrees off at once.
#[test]
fn a_bend_that_starts_between_two_scans_is_followed() {
    for seed in 1..=3 {
        let mut end = Pose::identity();
        for (k, refined) in (1..).zip(refined(seed)) {
            let off = true_motion(k).inv_mul(&refined.motion.motion);
            let turned = off.rotation.angle().to_degrees();
            assert_ne!(refined.outcome, Outcome::Predicted, "seed {seed}, scan {k}");
            assert!(turned.abs() < 2.6, "seed {seed}, scan {k}: {turned} deg");
            end *= refined.motion.motion;
        }
        let off = pose((SCANS - 1) as f64 * SWEEP_S).inv_mul(&end);
        let shift_m = off.translation.vector.norm();
        assert!(shift_m < 1.2, "seed {seed}: {shift_m:.2} m off at the end");
    }
}
