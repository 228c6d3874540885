//! A dataset in Oxford's format: reproducible, and in its conventions.

use std::{fs, path::Path};

use gyre_geometry::{Pose, OwnedScan, scan::flag};
use gyre_worlds::{profile::METADATA_BYTES, GyroProfile, SimulatedGyroConfig, SimulationConfig, Simulator, SimulatorError, write_dataset};

use crate::common::all_files;

fn config(scans: usize) -> SimulationConfig {
    SimulationConfig {
        scans: Some(scans),
        ..SimulationConfig::default()
    }
}

fn generate(config: &SimulationConfig) -> tempfile::TempDir {
    let folder = tempfile::tempdir().unwrap();
    write_dataset(config, folder.path(), &mut |_, _| {}).unwrap();
    folder
}

#[test]
fn same_configuration_writes_the_same_bytes() {
    let (first, second) = (generate(&config(4)), generate(&config(4)));
    assert_eq!(all_files(first.path()), all_files(second.path()));
    assert_eq!(all_files(first.path()).len(), 4 + 7);
}

#[test]
fn the_true_road_users_are_where_their_velocities_take_them() {
    let simulator = Simulator::new(&config(40)).unwrap();
    let (mut moved, mut hidden) = (0, 0);
    for scan in 0..39 {
        let later = simulator.road_users(scan + 1);
        for user in simulator.road_users(scan) {
            assert!((0.0..=1.0).contains(&user.visible) && user.counts >= 0.0);
            hidden += usize::from(user.visible < 0.1);
            let Some(next) = later.iter().find(|next| next.object == user.object) else {
                continue;
            };
            let way = next.pose.translation.vector - user.pose.translation.vector;
            let mean = (user.velocity + next.velocity) * 0.5;
            assert!((way / 0.25 - mean).norm() < 0.3, "{user:?} to {next:?}");
            moved += usize::from(mean.norm() > 2.0);
        }
    }
    assert!(moved > 20 && hidden > 20, "{moved} {hidden}");
}

#[test]
fn another_seed_gives_another_town() {
    let simulator = |seed| Simulator::new(&SimulationConfig { seed, ..config(1) }).unwrap();
    assert_ne!(
        simulator(1).render_scan(0).scan.bytes,
        simulator(2).render_scan(0).scan.bytes
    );
}

#[test]
fn scan_does_not_depend_on_the_scans_rendered_before_it() {
    let simulator = Simulator::new(&config(3)).unwrap();
    let alone = simulator.render_scan(2).scan.bytes;
    let mut sensor = simulator.sensor();
    let mut scan = OwnedScan::with_limits(simulator.limits());
    for index in 0..3 {
        simulator.render_into(index, &mut sensor, &mut scan.slot());
    }
    assert_eq!(scan.bytes, alone);
}

#[test]
fn progress_counts_every_scan_once() {
    let folder = tempfile::tempdir().unwrap();
    let mut seen = Vec::new();
    let summary = write_dataset(&config(3), folder.path(), &mut |done, total| {
        seen.push((done, total))
    })
    .unwrap();
    assert_eq!(seen, [(0, 3), (1, 3), (2, 3), (3, 3)]);
    assert_eq!(summary.scans, 3);
    assert!(
        (summary.duration_s - 0.5).abs() < 1e-9 && summary.path_m > 2.0,
        "{summary:?}"
    );
}

#[test]
fn stamps_and_encoder_increase_evenly_through_scan_and_dataset() {
    let simulator = Simulator::new(&config(2)).unwrap();
    let mut last_stamp = i64::MIN;
    for index in 0..2 {
        let scan = simulator.render_scan(index).scan;
        for azimuth in 0..400 {
            let row = &scan.bytes[azimuth * scan.geometry.stride..][..METADATA_BYTES];
            let stamp = i64::from_le_bytes(row[..8].try_into().unwrap());
            let encoder = u16::from_le_bytes([row[8], row[9]]);
            assert!(stamp > last_stamp);
            assert_eq!(usize::from(encoder), 13 + 14 * azimuth);
            // Lost azimuths are marked.
            assert_eq!(row[10] == 255, scan.flags[azimuth] == flag::MEASURED);
            assert_eq!(scan.stamp_ns[azimuth], stamp * 1000);
            last_stamp = stamp;
        }
    }
}

/// One row of `gt/radar_odometry.csv`.
struct TrueMotion {
    stamps: [i64; 2],
    images: [i64; 2],
    motion: Pose,
}

fn rows(folder: &Path) -> Vec<TrueMotion> {
    let text = fs::read_to_string(folder.join("gt/radar_odometry.csv")).unwrap();
    let mut lines = text.lines();
    assert_eq!(
        lines.next().unwrap(),
        "source_timestamp,destination_timestamp,x,y,z,roll,pitch,yaw,source_radar_timestamp,destination_radar_timestamp"
    );
    let row = |line: &str| {
        let fields: Vec<&str> = line.split(',').collect();
        let whole = |i: usize| fields[i].parse::<i64>().unwrap();
        let real = |i: usize| fields[i].parse::<f64>().unwrap();
        // From y right, yaw clockwise to y left, yaw counter-clockwise.
        let motion = gyre_geometry::pose(real(2), -real(3), -real(7));
        TrueMotion {
            stamps: [whole(0), whole(1)],
            images: [whole(8), whole(9)],
            motion,
        }
    };
    lines.map(row).collect()
}

#[test]
fn chain_of_csv_motions_equals_the_poses_of_the_path() {
    let folder = generate(&config(12));
    let simulator = Simulator::new(&config(12)).unwrap();
    let mut pose = simulator.pose(0);
    let rows = rows(folder.path());
    assert_eq!(rows.len(), 11);
    for (index, row) in rows.iter().enumerate() {
        pose *= row.motion;
        let error = pose.inverse() * simulator.pose(index + 1);
        assert!(
            error.translation.vector.norm() < 1e-6 && error.rotation.angle().abs() < 1e-7,
            "row {index}: {error}"
        );
        assert!(row.motion.translation.x > 0.0, "forward is positive");
    }
    let turn = pose.rotation.angle() - simulator.pose(0).rotation.angle();
    assert!(turn > 0.5, "the loop turns left: {turn} rad");
}

#[test]
fn csv_names_images_by_sweep_start_and_motions_by_sweep_middle() {
    let folder = generate(&config(3));
    let listed = fs::read_to_string(folder.path().join("radar.timestamps")).unwrap();
    let names: Vec<i64> = listed
        .lines()
        .map(|line| line.strip_suffix(" 1").unwrap().parse().unwrap())
        .collect();
    for (index, row) in rows(folder.path()).iter().enumerate() {
        assert_eq!(
            row.images,
            [names[index + 1], names[index]],
            "source is the newer scan"
        );
        for (stamp, image) in row.stamps.iter().zip(row.images) {
            let half_sweep_us = 250_000 * 399 / 400 / 2;
            assert_eq!(stamp - image, half_sweep_us);
            assert!(folder.path().join(format!("radar/{image}.png")).exists());
        }
    }
}

#[test]
fn folder_with_scans_of_another_drive_is_rejected() {
    let folder = generate(&config(3));
    let error = write_dataset(&config(2), folder.path(), &mut |_, _| {});
    assert!(
        matches!(error, Err(SimulatorError::OutputInUse { .. })),
        "{error:?}"
    );
    write_dataset(&config(3), folder.path(), &mut |_, _| {}).expect("the same drive again");
}

#[test]
fn invalid_configuration_names_its_key() {
    let error = |config: SimulationConfig| Simulator::new(&config).err().unwrap().to_string();
    assert!(error(config(0)).contains("`scans`"));
    let drive = gyre_worlds::drive::DriveConfig {
        speed_mps: f64::NAN,
        ..Default::default()
    };
    assert!(error(SimulationConfig { drive, ..config(1) }).contains("speed_mps`"));
    let unknown = toml::from_str::<SimulationConfig>("scanz = 3")
        .unwrap_err()
        .to_string();
    assert!(unknown.contains("scanz"), "{unknown}");
}

#[test]
fn a_gyro_adds_its_log_and_changes_nothing_else() {
    let gyro = SimulatedGyroConfig {
        profile: GyroProfile::Bmi088,
        ..SimulatedGyroConfig::default()
    };
    let without = all_files(generate(&config(3)).path());
    let mut with = all_files(generate(&SimulationConfig { gyro, ..config(3) }).path());
    let log = String::from_utf8(with.remove("imu.csv").unwrap()).unwrap();
    assert_eq!(log.lines().count(), 1 + 75);
    assert!(log.starts_with("stamp_ns,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,"));
    let made_by = with.insert(
        "simulation.toml".to_owned(),
        without["simulation.toml"].clone(),
    );
    assert!(
        String::from_utf8(made_by.unwrap())
            .unwrap()
            .contains("profile = \"bmi088\"")
    );
    assert!(!String::from_utf8_lossy(&without["simulation.toml"]).contains("gyro"));
    assert_eq!(with, without);
}
