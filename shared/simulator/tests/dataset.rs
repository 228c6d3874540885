//! A dataset in Oxford's format: reproducible, and in its conventions; paths along real
//! trajectories: distance from the poses, and limits of vehicle dynamics.

use std::{fs, path::PathBuf};

use crate::all_files;
use gyre_datasets::read_trajectory;
use gyre_simulator::{
    GyroProfile, Path, SimulatedGyroConfig, SimulationConfig, Simulator, path::recorded::read,
    write_dataset,
};
use nalgebra::Point2;

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
fn the_true_cars_are_where_their_velocities_take_them() {
    let folder = generate(&config(40));
    let text = fs::read_to_string(folder.path().join("objects.csv")).unwrap();
    let rows: Vec<Vec<f64>> = text.lines().skip(1).map(numbers).collect();
    assert!(rows.len() > 20, "{}", rows.len());
    let (mut moved, mut hidden, mut seen) = (0, 0, 0);
    for row in &rows {
        hidden += usize::from(row[11] < 0.1);
        seen += usize::from(row[11] > 0.5 && row[12] > 60.0);
        let next = rows
            .iter()
            .find(|next| next[0] == row[0] + 1.0 && next[2] == row[2]);
        let Some(next) = next else { continue };
        for axis in [0, 1] {
            let mean_mps = 0.5 * (row[7 + axis] + next[7 + axis]);
            let way_mps = (next[4 + axis] - row[4 + axis]) / 0.25;
            assert!((way_mps - mean_mps).abs() < 1.5, "{row:?} to {next:?}");
        }
        moved += usize::from(row[7].hypot(row[8]) > 5.0);
    }
    assert!(
        moved > 20 && hidden > 2 && seen > 2,
        "{moved} {hidden} {seen}"
    );
}

/// The numbers of a row; 0 in place of words.
fn numbers(line: &str) -> Vec<f64> {
    line.split(',')
        .map(|field| field.parse().unwrap_or(0.0))
        .collect()
}

#[test]
fn a_blind_radar_receives_noise_alone_and_a_tunnel_hides_the_town() {
    let with = |change: fn(&mut SimulationConfig)| {
        let mut config = config(20);
        change(&mut config);
        let simulator = Simulator::new(&config).unwrap();
        [4, 12].map(|index| {
            let scan = simulator.render_scan(index);
            let far = (0..400).flat_map(|azimuth| scan.view().row(azimuth)[600..].to_vec());
            far.filter(|power| *power > 60).count()
        })
    };
    let open = with(|_| ());
    let blind = with(|config| config.blind_s = Some([2.0, 4.0]));
    assert!(open[1] > 2000, "{open:?}");
    assert_eq!(blind, [open[0], 0]);
    let tunnel = with(|config| config.tunnel_m = Some([15.0, 60.0]));
    assert!(
        tunnel[0] > 1000 && 2 * tunnel[1] < open[1],
        "{open:?} {tunnel:?}"
    );
}

#[test]
fn another_seed_gives_other_streets_and_another_one_of_the_radar_the_same() {
    let simulator = |seed, noise| {
        let mut config = SimulationConfig { seed, ..config(1) };
        config.sensor.seed = noise;
        Simulator::new(&config).unwrap()
    };
    let (usual, other, again) = (
        simulator(1, None),
        simulator(2, None),
        simulator(1, Some(9)),
    );
    let scan = |simulator: &Simulator| simulator.render_scan(0).bytes;
    assert_ne!(scan(&usual), scan(&other));
    assert_ne!(scan(&usual), scan(&again));
    let places = |simulator: &Simulator| -> Vec<_> {
        let all = simulator.world().around(Point2::origin(), 1e6);
        all.map(|scatterer| scatterer.position).collect()
    };
    assert_ne!(places(&usual), places(&other));
    assert_eq!(places(&usual), places(&again));
}

#[test]
fn invalid_configuration_names_its_key() {
    let error = |config: SimulationConfig| Simulator::new(&config).err().unwrap().to_string();
    assert!(error(config(0)).contains("`scans`"));
    let drive = gyre_simulator::DriveConfig {
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

/// Poses a second in a file without times.
const RATE_HZ: f64 = 4.0;

fn real_files() -> Vec<PathBuf> {
    let Some(root) = std::env::var_os("GYRE_DATA") else {
        println!("skipped: GYRE_DATA is not set");
        return Vec::new();
    };
    [
        "boreas-2021-09-02-11-42-radar_poses.csv",
        "oxford-2019-01-10-11-46-21.radar_odometry.csv",
        "oxford-2019-01-16-13-09-37.kitti.txt",
    ]
    .map(|name| std::path::Path::new(&root).join("trajectories").join(name))
    .to_vec()
}

#[test]
fn real_drives_stay_close_to_their_poses() {
    for path in real_files() {
        let drive = read(&path, 0.0, RATE_HZ).unwrap();
        let given = read_trajectory(&path).unwrap();
        let seconds = |i: usize| {
            given
                .stamp_ns
                .as_ref()
                .map_or(i as f64 * 0.25, |s| (s[i] - s[0]) as f64 * 1e-9)
        };
        let origin = given.poses[0].inverse();
        let mut off: Vec<(f64, f64)> = (0..given.len())
            .map(|i| (origin * given.poses[i]).inverse() * drive.pose(seconds(i)))
            .map(|off| (off.translation.vector.norm(), off.rotation.angle().abs()))
            .collect();
        off.sort_by(|a, b| a.0.total_cmp(&b.0));
        let at = |share: f64| off[((off.len() - 1) as f64 * share) as usize].0;
        let turn = off.iter().map(|o| o.1).fold(0.0, f64::max);
        assert!(
            at(0.95) < 0.05 && at(0.99) < 0.1 && at(1.0) < 0.3 && turn < 0.01,
            "{} {} {turn}",
            at(0.99),
            at(1.0)
        );
        let drive = read(&path, 300.0, RATE_HZ).unwrap();
        assert!(drive.pose(0.0).translation.vector.norm() < 0.1);
        assert_eq!(drive.pose(-5.0), drive.pose(0.0));
        assert_eq!(drive.pose(1e6), drive.pose(drive.duration_s()));
        assert_eq!(drive.velocity(drive.duration_s() + 1.0).norm(), 0.0);
    }
}

#[test]
fn files_that_cannot_be_driven_are_rejected_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let line = |i: u32| format!("{}.0 0 {} 0 0 0 0 1\n", 1_600_000_000 + i, 5 * i);
    let sideways: String = (0..50).map(line).collect();
    let jumping = "1600000000.0 0 0 0 0 0 0 1\n1600000001.0 5e5 0 0 0 0 0 1\n";
    for (name, text, from_s, words) in [
        ("rotated.tum", Some(&*sideways), 0.0, "0 % of its length"),
        (
            "beyond.tum",
            Some(&*sideways),
            900.0,
            "fewer than two poses",
        ),
        (
            "jumps.tum",
            Some(jumping),
            0.0,
            "jumps by 500000.0 m within 1.000 s",
        ),
        ("nowhere.csv", None, 0.0, ""),
    ] {
        let path = folder.path().join(name);
        text.map_or(Ok(()), |text| fs::write(&path, text)).unwrap();
        let error = read(&path, from_s, RATE_HZ).unwrap_err().to_string();
        assert!(error.contains(name) && error.contains(words), "{error}");
    }
}
