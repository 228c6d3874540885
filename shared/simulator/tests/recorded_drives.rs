//! Paths along real trajectories: distance from the poses, and limits of vehicle dynamics.

use std::path::PathBuf;

use gyre_datasets::read_trajectory;
use gyre_simulator::Path;
use gyre_simulator::path::recorded::read;

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
    let rotated = folder.path().join("rotated.tum");
    let line = |i: u32| format!("{}.0 0 {} 0 0 0 0 1\n", 1_600_000_000 + i, 5 * i);
    std::fs::write(&rotated, (0..50).map(line).collect::<String>()).unwrap();
    let error = read(&rotated, 0.0, RATE_HZ).unwrap_err().to_string();
    assert!(
        error.contains("rotated.tum") && error.contains("0 % of its length"),
        "{error}"
    );
    let beyond = read(&rotated, 900.0, RATE_HZ).unwrap_err().to_string();
    assert!(beyond.contains("fewer than two poses"), "{beyond}");
    let jumping = folder.path().join("jumping.tum");
    std::fs::write(
        &jumping,
        "1600000000.0 0 0 0 0 0 0 1\n1600000001.0 5e5 0 0 0 0 0 1\n",
    )
    .unwrap();
    let error = read(&jumping, 0.0, RATE_HZ).unwrap_err().to_string();
    assert!(
        error.contains("jumps by 500000.0 m within 1.000 s"),
        "{error}"
    );
    let missing = read(std::path::Path::new("nowhere.csv"), 0.0, RATE_HZ)
        .unwrap_err()
        .to_string();
    assert!(missing.contains("nowhere.csv"), "{missing}");
}
