//! Paths along real trajectories: distance from the poses, and limits of vehicle dynamics.

use std::path::PathBuf;
use std::time::Instant;

use gyre_datasets::read_trajectory;
use gyre_simulator::Path;
use gyre_simulator::path::recorded::{Excerpt, read};

const WHOLE: Excerpt = Excerpt {
    from_s: 0.0,
    for_s: f64::INFINITY,
    rate_hz: 4.0,
};

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

/// Sorted magnitudes of the n-th derivative of a quantity along the drive, by differences over 50
/// ms.
fn derivative(drive: &dyn Path, order: usize, of: &dyn Fn(f64) -> [f64; 2]) -> Vec<f64> {
    let step = 0.05;
    let mut values: Vec<[f64; 2]> = (0..(drive.duration_s() / step) as usize)
        .map(|i| of(i as f64 * step))
        .collect();
    for _ in 0..order {
        values = values
            .windows(2)
            .map(|w| [0, 1].map(|d| (w[1][d] - w[0][d]) / step))
            .collect();
    }
    let mut sizes: Vec<f64> = values.iter().map(|v| v[0].hypot(v[1])).collect();
    sizes.sort_by(f64::total_cmp);
    sizes
}

#[test]
fn real_drives_stay_close_to_their_poses() {
    for path in real_files() {
        let started = Instant::now();
        let drive = read(&path, WHOLE).unwrap();
        let loaded = started.elapsed();
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
        println!(
            "{}: loaded in {loaded:?}, off by {:.3} m (95 %), {:.3} m (most)",
            path.display(),
            at(0.95),
            at(1.0)
        );
        assert!(
            at(0.95) < 0.05 && at(0.99) < 0.1 && at(1.0) < 0.3 && turn < 0.01,
            "{} {} {turn}",
            at(0.99),
            at(1.0)
        );
        assert!(loaded.as_secs_f64() < 0.5);
    }
}

#[test]
fn real_drives_respect_the_limits_of_a_car() {
    for path in real_files() {
        let drive = read(&path, WHOLE).unwrap();
        let velocity = |time: f64| drive.velocity(time).into();
        let heading = |time: f64| {
            [
                drive.pose(time).rotation.cos_angle(),
                drive.pose(time).rotation.sin_angle(),
            ]
        };
        let share =
            |sorted: &[f64], share: f64| sorted[((sorted.len() - 1) as f64 * share) as usize];
        let (acceleration, jerk) = (
            derivative(&drive, 1, &velocity),
            derivative(&drive, 2, &velocity),
        );
        let yaw_rate = derivative(&drive, 1, &heading);
        assert!(
            share(&acceleration, 0.99) < 3.0 && share(&acceleration, 1.0) < 5.0,
            "m/s2"
        );
        assert!(share(&jerk, 0.99) < 4.0 && share(&jerk, 1.0) < 12.0, "m/s3");
        assert!(share(&yaw_rate, 1.0) < 0.9, "rad/s");
        let ahead = |i: usize| {
            let time = i as f64 * 0.1;
            (drive.pose(time).rotation.inverse() * drive.velocity(time)).x
        };
        let ahead: Vec<f64> = (0..(drive.duration_s() * 10.0) as usize)
            .map(ahead)
            .collect();
        let still =
            ahead.iter().filter(|speed| speed.abs() < 0.01).count() as f64 / ahead.len() as f64;
        assert!(ahead.iter().all(|speed| *speed > -0.4), "drives backwards");
        assert!(
            still > 0.08,
            "these drives wait at lights, but stand only {still}"
        );
    }
}

#[test]
fn excerpt_starts_at_the_origin_and_stands_before_and_after() {
    for path in real_files() {
        let drive = read(
            &path,
            Excerpt {
                from_s: 300.0,
                for_s: 60.0,
                ..WHOLE
            },
        )
        .unwrap();
        assert!((59.0..=60.0).contains(&drive.duration_s()));
        assert!(drive.pose(0.0).translation.vector.norm() < 0.1);
        assert_eq!(drive.pose(-5.0), drive.pose(0.0));
        assert_eq!(drive.pose(1e6), drive.pose(drive.duration_s()));
        assert_eq!(drive.velocity(61.0).norm(), 0.0);
    }
}

#[test]
fn files_that_cannot_be_driven_are_rejected_by_name() {
    let folder = tempfile::tempdir().unwrap();
    let rotated = folder.path().join("rotated.tum");
    let line = |i: u32| format!("{}.0 0 {} 0 0 0 0 1\n", 1_600_000_000 + i, 5 * i);
    std::fs::write(&rotated, (0..50).map(line).collect::<String>()).unwrap();
    let error = read(&rotated, WHOLE).unwrap_err().to_string();
    assert!(
        error.contains("rotated.tum") && error.contains("0 % of its length"),
        "{error}"
    );
    let beyond = read(
        &rotated,
        Excerpt {
            from_s: 900.0,
            ..WHOLE
        },
    )
    .unwrap_err()
    .to_string();
    assert!(beyond.contains("fewer than two poses"), "{beyond}");
    let jumping = folder.path().join("jumping.tum");
    std::fs::write(
        &jumping,
        "1600000000.0 0 0 0 0 0 0 1\n1600000001.0 5e5 0 0 0 0 0 1\n",
    )
    .unwrap();
    let error = read(&jumping, WHOLE).unwrap_err().to_string();
    assert!(
        error.contains("jumps by 500000.0 m within 1.000 s"),
        "{error}"
    );
    let missing = read(std::path::Path::new("nowhere.csv"), WHOLE)
        .unwrap_err()
        .to_string();
    assert!(missing.contains("nowhere.csv"), "{missing}");
}
