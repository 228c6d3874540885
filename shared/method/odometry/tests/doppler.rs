//! The velocity by Doppler on simulated scans of a RAS6, against the true velocity. Roads as hard
//! as real ones are in `research/worlds/tests/method/doppler.rs`.

use gyre_datasets::open_source;
use gyre_radar::{DopplerEstimator, OwnedScan, PointsConfig};
use gyre_simulator::{OutputFormat, Profile, SimulatedDrive, SimulationConfig};
use nalgebra::Vector2;

#[test]
fn scans_of_a_street_tell_the_velocity() {
    let mut config = SimulationConfig {
        scans: Some(48),
        ..SimulationConfig::default()
    };
    config.sensor.profile = Profile::Ras6;
    config.output.format = Some(OutputFormat::Boreas);
    let drive = SimulatedDrive::new(&config).unwrap();
    let options = drive.dataset_options();
    let mut dataset = open_source(Box::new(drive.renderer()), &options).unwrap();
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let mut estimator = DopplerEstimator::default();
    let min_range_m = PointsConfig::default().min_range_m;
    let (mut silent, mut worst_mps) = (0, 0.0_f64);
    for index in (0..dataset.len()).step_by(4) {
        scan.geometry = dataset.read(index, scan.slot()).unwrap();
        let simulator = drive.simulator();
        let time = simulator.time(index);
        let middle_s = time.drive_time_s(time.middle_us());
        let path = simulator.path();
        let truth = path.pose(middle_s).rotation.inverse() * path.velocity(middle_s);
        match estimator.estimate(&scan.view(), min_range_m) {
            Ok(found) => {
                let off = Vector2::from(found.velocity_mps) - truth;
                worst_mps = worst_mps.max(off.norm());
            }
            Err(_) => silent += 1,
        }
    }
    println!("{silent} silent, {worst_mps} m/s");
    assert!(
        silent <= 1 && worst_mps < 0.5,
        "{silent} silent, {worst_mps} m/s"
    );
}
