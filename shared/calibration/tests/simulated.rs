//! The constants of simulated radars, which are known.

#![allow(clippy::unwrap_used)]

use gyre_calibration::{Calibration, Drive, Fact, calibrate};
use gyre_odometry::OdometryConfig;
use gyre_radar::{DatasetOptions, OwnedScan};
use gyre_simulator::{Profile, SimulatedDrive, SimulationConfig};

const ECCENTRICITY_RAD: f64 = 4e-3;
const DOPPLER_S: f64 = 0.042;

/// Calibrates a short drive around a block that is read with these constants.
fn calibrated(azimuth_eccentricity_rad: f64, doppler_s: f64) -> Calibration {
    let mut config = SimulationConfig {
        scans: Some(90),
        ..SimulationConfig::default()
    };
    config.sensor.profile = Profile::Cts350xRadiate;
    config.sensor.azimuth_eccentricity_rad = ECCENTRICITY_RAD;
    config.sensor.doppler_s = Some(DOPPLER_S);
    let simulated = SimulatedDrive::new(&config).unwrap();
    let options = DatasetOptions {
        azimuth_eccentricity_rad: Some(azimuth_eccentricity_rad as f32),
        doppler_s: Some(doppler_s as f32),
        ..simulated.dataset_options()
    };
    let mut dataset = gyre_radar::open_source(Box::new(simulated.renderer()), &options).unwrap();
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let mut drive = Drive::new(&OdometryConfig::default()).unwrap();
    for index in 0..dataset.len() {
        scan.geometry = dataset.read(index, scan.slot()).unwrap();
        drive.push(&scan).unwrap();
    }
    calibrate(&drive).unwrap()
}

#[test]
fn constants_that_were_configured_wrong_are_found() {
    let found = calibrated(0.0, 0.02);
    for (fact, wrong_by) in [
        (Fact::RangeOffset, 0.0),
        (Fact::EccentricityCos, ECCENTRICITY_RAD),
        (Fact::Doppler, DOPPLER_S - 0.02),
    ] {
        let change = found.facts[fact as usize].change;
        let sigmas = (change.value - wrong_by) / change.sigma;
        assert!(sigmas.abs() < 3.0, "{fact:?}: {change:?} for {wrong_by}");
        let is_called_wrong = change.value.abs() > 3.0 * change.sigma;
        assert_eq!(is_called_wrong, wrong_by != 0.0, "{fact:?}: {change:?}");
    }
}
