//! The examples that people copy: `examples/own_sensor.rs`, `examples/own_dataset.rs` and
//! `examples/own_search.rs`.

#[allow(dead_code)] // Its `main`.
#[path = "../../../../../examples/own_dataset.rs"]
mod own_dataset;
#[allow(dead_code)] // Its `main`.
#[path = "../../../../../examples/own_search.rs"]
mod own_search;
#[allow(dead_code)] // Its `main`.
#[path = "../../../../../examples/own_sensor.rs"]
mod own_sensor;

use std::fs;

use gyre_datasets::{DatasetOptions, InspectedLogs, inspect_dataset};
use gyre_matching::odometry::Outcome;
use gyre_radar::RasterConfig;
use gyre_simulator::{Profile, SimulatedDrive, SimulationConfig, Simulator};
use own_dataset::RawSweeps;

#[test]
fn an_own_sensor_drives_two_metres_in_each_sweep() {
    let drive = own_sensor::drive(20).unwrap();
    let end = drive[19].pose.motion.translation.vector;
    assert!((end.x - 38.0).abs() < 0.3 && end.y.abs() < 0.3, "{end}");
}

#[test]
fn an_own_dataset_is_registered_and_inspected() {
    let mut config = SimulationConfig {
        scans: Some(8),
        ..SimulationConfig::default()
    };
    config.sensor.profile = Profile::Cts350xRadiate;
    let drive = SimulatedDrive::new(&config).unwrap();
    let folder = tempfile::tempdir().unwrap();
    for index in 0..drive.scans() {
        let scan = drive.simulator().render_scan(index);
        let power: Vec<u8> = scan.view().power().iter().copied().collect();
        let name = format!("{}.u8", scan.geometry.stamp_ns);
        fs::write(folder.path().join(name), power).unwrap();
    }

    let trajectory = own_dataset::drive(&mut RawSweeps::open(folder.path()).unwrap()).unwrap();
    let pose = |index| drive.simulator().pose(index);
    let truth = pose(0).inv_mul(&pose(7));
    let off = truth.inv_mul(&trajectory.poses[7]).translation.vector;
    assert!(truth.translation.vector.norm() > 5.0);
    assert!(off.norm() < 0.5, "{off}");

    let damaged = fs::read_dir(folder.path()).unwrap().next().unwrap();
    fs::write(damaged.unwrap().path(), "too short").unwrap();
    let dataset = Box::new(RawSweeps::open(folder.path()).unwrap());
    let options = DatasetOptions::default();
    let logs = InspectedLogs::default();
    let report = inspect_dataset(folder.path(), dataset, &options, &logs).to_string();
    assert!(
        report.contains("other") && report.contains("has 9 bytes"),
        "{report}"
    );
}

#[test]
fn an_own_search_turns_as_its_gyroscope_says() {
    let config = SimulationConfig {
        scans: Some(8),
        ..SimulationConfig::default()
    };
    let simulator = Simulator::new(&config).unwrap();
    let registered = own_search::drive(&simulator).unwrap();
    for (k, scan) in registered.iter().enumerate().skip(1) {
        let truth = simulator.pose(k - 1).inv_mul(&simulator.pose(k));
        let searched = scan.searched.unwrap();
        assert_eq!(
            searched.rotation.variance_rad2,
            own_search::SIGMA_RAD.powi(2)
        );
        let off_rad = searched.rotation.angle_rad - truth.rotation.angle();
        assert!(
            off_rad.abs() < 3.0 * own_search::SIGMA_RAD,
            "{k}: {off_rad}"
        );
        let off_m = searched.motion.pose().translation.vector - truth.translation.vector;
        // A search finds the cell; the refinement is finer.
        let cell_m = f64::from(RasterConfig::default().cell_m);
        assert!(off_m.norm() < cell_m, "{k}: {off_m}");
        assert_eq!(scan.outcome, Outcome::Refined);
    }
}
