//! Backscatter of the ground: where it is, occlusion, and that its patches are fixed in the world.

use std::f64::consts::TAU;

use gyre_geometry::{Pose, OwnedScan};
use gyre_worlds::{body::Wall, profile::Profile, Effects, Path};
use nalgebra::Point2;

use super::scene::{Setup, db, is_dark, mean_db, power, powers};

const GROUND: Effects = Effects {
    ground: true,
    ..Effects::NONE
};

/// RADIATE's radar, whose floor masks least of it.
fn setup(effects: Effects) -> Setup<'static> {
    Setup {
        effects,
        ..Setup::default()
    }
    .with(Profile::Cts350xRadiate)
}

#[test]
fn ground_surrounds_the_sensor_falls_with_range_and_has_a_switch() {
    let on = setup(GROUND);
    let scans = on.scans(4);
    let level = |range_m| mean_db(&scans, 0..400, on.bins(range_m));
    let (near, far) = (level(8.0..40.0), level(70.0..90.0));
    assert!(near > 2.0 && near > far + 2.0, "{near} dB and {far} dB");
    assert!(is_dark(&setup(Effects::NONE).scan()));
}

#[test]
fn an_opaque_wall_hides_the_ground_behind_it_and_not_in_front() {
    let scan = |occlusion, walled: bool| {
        let mut setup = setup(Effects {
            occlusion,
            ..GROUND
        });
        let corner = |x| Point2::new(x, -8.0);
        let wall = Wall::rough(corner(-20.0), corner(20.0), 1e-6, 1);
        setup.body.walls.extend(walled.then_some(wall));
        setup.scan()
    };
    let (open, hidden) = (scan(true, false), scan(true, true));
    let right = 85..115;
    let (before, behind) = (
        setup(GROUND).bins(0.0..5.0),
        setup(GROUND).bins(12.0..100.0),
    );
    for azimuth in right.clone() {
        let (open, hidden) = (open.view().row(azimuth), hidden.view().row(azimuth));
        assert_eq!(open[before.clone()], hidden[before.clone()]);
        assert!(
            hidden[behind.clone()].iter().all(|count| *count == 0),
            "azimuth {azimuth}"
        );
    }
    assert!(mean_db(std::slice::from_ref(&open), right, behind) > 1.0);
    assert_eq!(powers(&scan(false, true)), powers(&open));
}

/// A sensor at rest.
struct Parked(Pose);

impl Path for Parked {
    fn pose(&self, _: f64) -> Pose {
        self.0
    }
}

/// Brightness of the ground around places in the sensor's frame: power with the dependence on range
/// removed, dB.
fn brightness_db(scans: &[OwnedScan], places: impl Iterator<Item = Point2<f64>>) -> Vec<f64> {
    let setup = setup(GROUND);
    let about = |place: Point2<f64>| {
        let (range_m, azimuth) = (place.coords.norm(), (-place.y).atan2(place.x) / TAU * 400.0);
        let azimuths =
            (-3..=3).map(|beside| (azimuth.round() as i64 + beside).rem_euclid(400) as usize);
        let gain = db(setup.receiver().sensitivity(range_m) * range_m);
        // The minimum power counts as none.
        let bins = setup.bins(range_m - 1.0..range_m + 1.0);
        let mean = 10f64.powf(mean_db(scans, azimuths.collect::<Vec<_>>(), bins) / 10.0);
        db((mean - power(0)).max(0.05)) - gain
    };
    places.map(about).collect()
}

fn correlation(a: &[f64], b: &[f64]) -> f64 {
    let mean = |values: &[f64]| values.iter().sum::<f64>() / values.len() as f64;
    let moment = |a: &[f64], b: &[f64]| {
        a.iter()
            .zip(b)
            .map(|(x, y)| (x - mean(a)) * (y - mean(b)))
            .sum::<f64>()
    };
    moment(a, b) / (moment(a, a) * moment(b, b)).sqrt()
}

#[test]
fn the_same_patches_appear_from_two_poses() {
    let poses = [Pose::identity(), gyre_geometry::pose(24.0, 7.0, 1.9)];
    // Between the two poses.
    let places = || {
        (0..=8).flat_map(|i| {
            (-8..=8).map(move |j| Point2::new(8.0 + f64::from(i), 2.0 * f64::from(j)))
        })
    };
    let seen = |pose: Pose, from: Pose| {
        let parked = Parked(pose);
        let scans = Setup {
            path: &parked,
            ..setup(GROUND)
        }
        .scans(6);
        brightness_db(
            &scans,
            places().map(|place| from.inverse_transform_point(&place)),
        )
    };
    let [first, second] = poses.map(|pose| seen(pose, pose));
    let elsewhere = seen(Pose::translation(1000.0, 0.0), poses[0]);
    let (same, other) = (
        correlation(&first, &second),
        correlation(&first, &elsewhere),
    );
    assert!(
        same > 0.5 && same > other + 0.3,
        "{same}, and {other} elsewhere"
    );
}
