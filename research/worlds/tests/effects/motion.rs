//! Motion of the sensor and of objects, and of the beam relative to its encoder.

use std::f64::consts::TAU;

use gyre_datasets::DatasetOptions;
use gyre_geometry::{Pose, Twist, OwnedScan};
use gyre_worlds::{profile::Profile, Body, Effects, Movers, Moving, SensorConfig, SimulationConfig, write_dataset};
use nalgebra::{Point2, Vector2};

use super::scene::{Setup, only, peak_bin, post, power};

const AHEAD: Twist = Twist {
    vx_mps: 20.0,
    vy_mps: 0.0,
    yaw_rate_radps: 0.0,
};

/// The azimuth, with fractions, of the centre of a single point's power.
fn centre(scan: &OwnedScan) -> f64 {
    let sums = |azimuth: usize| {
        scan.view()
            .row(azimuth)
            .iter()
            .map(|count| power(*count) - power(0))
            .sum::<f64>()
    };
    let weights: Vec<f64> = (0..scan.geometry.azimuths).map(sums).collect();
    let moment: f64 = weights
        .iter()
        .enumerate()
        .map(|(azimuth, weight)| azimuth as f64 * weight)
        .sum();
    moment / weights.iter().sum::<f64>()
}

#[test]
fn azimuths_are_measured_from_their_own_poses_or_all_from_the_middle() {
    // At azimuth 100, a quarter of the sweep, the car is 1.25 m before the middle.
    let measured = |sweep_motion| {
        let mut setup = Setup::of(
            vec![post(20.0, 100.0, 3.0)],
            only(|e| &mut e.sweep_motion, sweep_motion),
        );
        setup.path = &AHEAD;
        centre(&setup.scan())
    };
    assert!(
        (measured(false) - 100.0).abs() < 0.05,
        "{}",
        measured(false)
    );
    let turned = -(1.25f64 / 20.0).atan() / TAU * 400.0;
    assert!(
        (measured(true) - 100.0 - turned).abs() < 0.15,
        "{} for {}",
        measured(true),
        100.0 + turned
    );
}

/// A post that moves at 10 m/s to the right, starting 20 m to the right.
struct Leaving(Body);

impl Movers for Leaving {
    fn visit<'a>(&'a self, time_s: f64, _: Point2<f64>, _: f64, see: &mut dyn FnMut(Moving<'a>)) {
        let pose = Pose::translation(0.0, -10.0 * time_s);
        see(Moving {
            body: &self.0,
            pose,
            velocity: Vector2::new(0.0, -10.0),
        });
    }
}

#[test]
fn a_moving_object_appears_where_it_is_when_the_beam_passes() {
    let leaving = Leaving(Body::of(vec![post(20.0, 100.0, 3.0)]));
    for (sweep_motion, expected_m) in [(true, [19.375, 24.375]), (false, [20.0, 25.0])] {
        let setup = Setup {
            movers: &leaving,
            effects: only(|e| &mut e.sweep_motion, sweep_motion),
            ..Setup::default()
        };
        let scans = setup.scans(3);
        for (scan, expected_m) in [&scans[0], &scans[2]].into_iter().zip(expected_m) {
            let range_m = setup.sampling().range_m(peak_bin(scan, 100));
            assert!(
                (range_m - expected_m).abs() < 0.05,
                "{range_m} m for {expected_m} m"
            );
        }
    }
}

#[test]
fn approaching_objects_are_too_near_with_rising_chirps_and_too_far_with_falling_ones() {
    let shifts_m = |profile: Profile, azimuth: f64| {
        let measured = |doppler| {
            let mut setup = Setup::of(
                vec![post(30.0, azimuth, 3.0)],
                only(|e| &mut e.doppler, doppler),
            )
            .with(profile);
            setup.path = &AHEAD;
            let scan = setup.scan();
            [0, 1].map(|side| {
                setup
                    .sampling()
                    .range_m(peak_bin(&scan, azimuth as usize + side))
            })
        };
        let (on, off) = (measured(true), measured(false));
        [on[0] - off[0], on[1] - off[1]]
    };
    // 9 degrees off the direction of travel: 19.75 m/s.
    for (profile, azimuth, expected) in [
        (Profile::Cts350xOxford, 10.0, [-0.83, -0.83]),
        (Profile::Cts350xOxford, 210.0, [0.83, 0.83]),
        (Profile::Ras6, 10.0, [-1.0, 1.0]),
        (Profile::Ras6, 210.0, [1.0, -1.0]),
        (Profile::Ras6, 211.0, [-1.0, 1.0]),
        (Profile::K2pi, 10.0, [0.0, 0.0]),
    ] {
        let found = shifts_m(profile, azimuth);
        let off = found
            .iter()
            .zip(expected)
            .map(|(found, expected)| (found - expected).abs());
        assert!(
            off.fold(0.0, f64::max) < 0.05,
            "{profile:?} at {azimuth}: {found:?} m for {expected:?} m"
        );
    }
}

#[test]
fn an_azimuth_reports_its_chirp() {
    let setup = Setup::of(vec![], Effects::ALL).with(Profile::Ras6);
    let scan = setup.scan();
    for azimuth in 0..400 {
        let sign = if azimuth % 2 == 0 { 1.0 } else { -1.0 };
        assert_eq!(
            scan.view().doppler_s(azimuth),
            sign * setup.sampling().doppler_s as f32
        );
    }
}

#[test]
fn encoder_eccentricity_turns_the_beam_by_its_cosine() {
    const ECCENTRICITY_RAD: f64 = 0.02;
    for azimuth in [30.0, 100.0, 200.0, 250.0, 390.0] {
        let measured = |encoder_wobble| {
            let effects = only(|e| &mut e.encoder_wobble, encoder_wobble);
            let mut setup = Setup::of(vec![post(30.0, azimuth, 3.0)], effects);
            setup.sensor = SensorConfig {
                azimuth_eccentricity_rad: ECCENTRICITY_RAD,
                ..setup.sensor
            };
            let angle = |azimuth: f64| setup.sampling().azimuth_rad(0) + azimuth * TAU / 400.0;
            angle(centre(&setup.scan()))
        };
        let (truth, reported) = (measured(false), measured(true));
        let corrected = reported + ECCENTRICITY_RAD * reported.cos();
        let twentieth_rad = 0.05 * TAU / 400.0;
        assert!(
            (corrected - truth).abs() < twentieth_rad,
            "azimuth {azimuth}: {} rad",
            corrected - truth
        );
    }
}

#[test]
fn a_readers_correction_cancels_the_eccentricity() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = SimulationConfig {
        scans: Some(1),
        effects: Effects::NONE,
        ..SimulationConfig::default()
    };
    config.sensor.azimuth_eccentricity_rad = 0.02;
    write_dataset(&config, folder.path(), &mut |_, _| {}).unwrap();
    let read = |azimuth_eccentricity_rad| {
        let options = DatasetOptions {
            azimuth_eccentricity_rad,
            ..DatasetOptions::default()
        };
        let mut dataset = gyre_datasets::open(folder.path(), &options).unwrap();
        let mut scan = OwnedScan::with_limits(dataset.limits());
        scan.geometry = dataset.read(0, scan.slot()).unwrap();
        scan.view().azimuth_rad.to_vec()
    };
    assert_eq!(read(None), read(Some(0.02)), "the recording says so itself");
    for (reported, corrected) in read(Some(0.0)).into_iter().zip(read(Some(0.02))) {
        let expected = (reported + 0.02 * reported.cos()).rem_euclid(TAU as f32);
        assert!(
            (corrected - expected).abs() < 1e-5,
            "{corrected} for {expected}"
        );
    }
}
