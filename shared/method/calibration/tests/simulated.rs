//! The constants of simulated radars, which are known.

#![allow(clippy::unwrap_used)]

use gyre_calibration::{Calibration, Drive, Fact, calibrate};
use gyre_datasets::DatasetOptions;
use gyre_geometry::OwnedScan;
use gyre_matching::odometry::OdometryConfig;
use gyre_simulator::{Profile, SimulatedDrive, SimulationConfig};

const ECCENTRICITY_RAD: f64 = 4e-3;
const OFFSET_WRONG_BY_M: f64 = 0.3;

/// Calibrates a short drive around a block that is read with wrong constants: range offset (m),
/// eccentricity (rad), Doppler coefficient (s).
fn calibrated(profile: Profile, wrong_by: [f64; 3]) -> Calibration {
    let mut config = SimulationConfig {
        scans: Some(150),
        ..SimulationConfig::default()
    };
    config.sensor.profile = profile;
    config.sensor.azimuth_eccentricity_rad = ECCENTRICITY_RAD;
    let simulated = SimulatedDrive::new(&config).unwrap();
    let right = simulated.dataset_options();
    let off = |right: Option<f32>, by: f64| Some((f64::from(right.unwrap()) + by) as f32);
    let options = DatasetOptions {
        range_offset_m: off(right.range_offset_m, wrong_by[0]),
        azimuth_eccentricity_rad: off(right.azimuth_eccentricity_rad, wrong_by[1]),
        doppler_s: off(right.doppler_s, wrong_by[2]),
        ..right
    };
    let mut dataset = gyre_datasets::open_source(Box::new(simulated.renderer()), &options).unwrap();
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let mut drive = Drive::new(&OdometryConfig::default()).unwrap();
    for index in 0..dataset.len() {
        scan.geometry = dataset.read(index, scan.slot()).unwrap();
        drive.push(&scan).unwrap();
    }
    let (track, _) = drive.mean_track().unwrap();
    calibrate(&drive, track, &|| ()).unwrap()
}

fn assert_found(profile: Profile, doppler_wrong_by_s: f64) {
    let all_wrong_by = [OFFSET_WRONG_BY_M, -ECCENTRICITY_RAD, doppler_wrong_by_s];
    let found = calibrated(profile, all_wrong_by);
    assert!(found.has_settled);
    for (fact, wrong_by) in Fact::ALL.into_iter().zip(all_wrong_by) {
        let change = found.changes[fact as usize];
        let sigmas = (change.value + wrong_by) / change.sigma;
        assert!(sigmas.abs() < 3.0, "{fact:?}: {change:?} for {}", -wrong_by);
        let is_called_wrong = change.value.abs() > 3.0 * change.sigma;
        assert!(is_called_wrong, "{fact:?}: {change:?} for {}", -wrong_by);
    }
}

#[test]
#[ignore = ".ci/nightly: takes most of a minute"]
fn wrong_constants_are_found_where_all_chirps_rise() {
    assert_found(Profile::Cts350xRadiate, -0.02);
}

#[test]
#[ignore = ".ci/nightly: takes most of a minute"]
fn wrong_constants_are_found_where_chirps_alternate() {
    // Read without any Doppler shift, as where it is unknown.
    assert_found(Profile::Ras6, -0.0505);
}
