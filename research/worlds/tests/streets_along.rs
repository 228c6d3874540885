//! Streets laid along drives: each once, wide enough, with side streets that keep their distance.

use std::f64::consts::PI;
use std::time::Instant;

use crate::common::lap_s;
use gyre_geometry::Pose;
use gyre_geometry::Twist;
use gyre_worlds::lanes::DrivingSide;
use gyre_worlds::path::SplinePath;
use gyre_worlds::path::recorded::{Excerpt, read};
use gyre_worlds::{BlockLoop, Path, Streets};
use nalgebra::{Point2, Vector2};

/// Maximum clearance of the vehicle's centre along a drive: below -1.2 m it is on the carriageway
/// everywhere.
fn worst_clearance(drive: &dyn Path, duration_s: f64, streets: &Streets) -> f64 {
    let place = |i: usize| Point2::from(drive.pose(i as f64 * 0.1).translation.vector);
    (0..(duration_s * 10.0) as usize)
        .map(|i| streets.clearance_m(place(i), 20.0))
        .fold(f64::MIN, f64::max)
}

fn length_m(streets: &Streets, driven: bool) -> f64 {
    streets
        .streets()
        .iter()
        .filter(|s| s.driven == driven)
        .map(|s| s.length_m())
        .sum()
}

/// A drive along points at walking pace, heading from each to the next.
fn along_points(points: &[(f64, f64)], reversing: &[bool]) -> SplinePath {
    let mut poses = Vec::new();
    let mut time_s = 0.0;
    for (ends, back) in points.windows(2).zip(reversing) {
        let (from, to) = (
            Vector2::new(ends[0].0, ends[0].1),
            Vector2::new(ends[1].0, ends[1].1),
        );
        let segment = to - from;
        let yaw = segment.y.atan2(segment.x) + if *back { PI } else { 0.0 };
        let steps = (segment.norm() / 0.5) as usize;
        for step in 0..steps {
            poses.push((
                time_s,
                Pose::new(from + segment * (step as f64 / steps as f64), yaw),
            ));
            time_s += 0.25;
        }
    }
    SplinePath::new(&poses, 0.7)
}

#[test]
fn laps_of_a_block_are_one_ring_of_streets() {
    let block = BlockLoop::new(120.0, 90.0, 9.5, 5.0);
    for keep in [DrivingSide::Left, DrivingSide::Right] {
        let streets = Streets::along(&block, 5.0 * lap_s(&block), keep, 1);
        assert!(
            (length_m(&streets, true) - block.lap_m()).abs() < 20.0,
            "{}",
            length_m(&streets, true)
        );
        assert!(worst_clearance(&block, lap_s(&block), &streets) < -1.2);
        let middle = streets
            .nearest(Point2::from(block.pose(0.0).translation.vector), 5.0)
            .unwrap();
        assert!((middle.offset_m - 1.6).abs() < 0.2, "{middle:?}");
        assert!(length_m(&streets, false) > 200.0);
    }
}

#[test]
fn passes_in_both_directions_are_one_street() {
    let there_and_back = [
        (0.0, 0.0),
        (400.0, 0.0),
        (403.0, 3.0),
        (400.0, 6.0),
        (0.0, 4.0),
    ];
    let drive = along_points(&there_and_back, &[false; 4]);
    let streets = Streets::along(&drive, f64::INFINITY, DrivingSide::Right, 3);
    assert!(
        (length_m(&streets, true) - 400.0).abs() < 40.0,
        "{}",
        length_m(&streets, true)
    );
    assert!(worst_clearance(&drive, drive.duration_s(), &streets) < -1.2);
}

#[test]
fn three_point_turns_and_standing_give_streets() {
    let turn = [
        (0.0, 0.0),
        (100.0, 0.0),
        (104.0, 5.0),
        (104.5, -3.0),
        (100.0, 3.5),
        (0.0, 3.5),
    ];
    let drive = along_points(&turn, &[false, false, true, false, false]);
    let streets = Streets::along(&drive, f64::INFINITY, DrivingSide::Right, 3);
    assert!(
        length_m(&streets, true) < 150.0,
        "{}",
        length_m(&streets, true)
    );
    assert!(worst_clearance(&drive, drive.duration_s(), &streets) < -1.2);
    let on_the_spot = Twist {
        yaw_rate_radps: 0.7,
        ..Twist::default()
    };
    for drive in [Twist::default(), on_the_spot] {
        let streets = Streets::along(&drive, 60.0, DrivingSide::Left, 3);
        assert!(worst_clearance(&drive, 60.0, &streets) < -1.2);
    }
}

#[test]
fn same_seed_draws_the_same_streets_and_another_seed_others() {
    let block = BlockLoop::new(300.0, 200.0, 9.5, 5.0);
    let drawn = |seed| {
        Streets::along(&block, 200.0, DrivingSide::Left, seed)
            .streets()
            .to_vec()
    };
    assert_eq!(drawn(1), drawn(1));
    assert_ne!(drawn(1), drawn(2));
}

#[test]
fn side_streets_keep_their_distance_from_all_others() {
    let block = BlockLoop::new(300.0, 200.0, 9.5, 5.0);
    for seed in 0..20 {
        let streets = Streets::along(&block, 200.0, DrivingSide::Left, seed);
        let all = streets.streets();
        for (number, side) in all.iter().enumerate().filter(|(_, s)| !s.driven) {
            let others = Streets::new(
                all.iter()
                    .enumerate()
                    .filter(|(n, _)| *n != number)
                    .map(|(_, s)| s.clone())
                    .collect(),
            );
            let beside = |along: &f64| {
                let place = Point2::from(side.at(*along).translation.vector);
                others.clearance_m(place, 30.0) < 10.0
            };
            let places: Vec<f64> = (40..side.length_m() as usize)
                .map(|along| along as f64)
                .collect();
            let near = places
                .split(|along| !beside(along))
                .map(<[f64]>::len)
                .max()
                .unwrap_or(0);
            assert!(
                near < 45,
                "seed {seed}: street {number} has another beside it for {near} m"
            );
        }
    }
}

#[test]
fn real_drives_get_streets_quickly() {
    let Some(root) = std::env::var_os("GYRE_DATA") else {
        println!("skipped: GYRE_DATA is not set");
        return;
    };
    let files = [
        (
            "boreas-2021-09-02-11-42-radar_poses.csv",
            DrivingSide::Right,
        ),
        (
            "oxford-2019-01-10-11-46-21.radar_odometry.csv",
            DrivingSide::Left,
        ),
        ("oxford-2019-01-16-13-09-37.kitti.txt", DrivingSide::Left),
    ];
    for (name, keep) in files {
        let drive = read(
            &std::path::Path::new(&root).join("trajectories").join(name),
            Excerpt::default(),
        )
        .unwrap();
        let started = Instant::now();
        let streets = Streets::along(&drive, drive.duration_s(), keep, 1);
        let built = started.elapsed();
        let asked = 400_000;
        let place = |i: u32| {
            drive.pose(drive.duration_s() * f64::from(i) / f64::from(asked))
                * Point2::new(3.0, f64::from(i % 23) - 11.0)
        };
        let places: Vec<Point2<f64>> = (0..asked).map(place).collect();
        let started = Instant::now();
        let sum: f64 = places
            .iter()
            .map(|place| streets.clearance_m(*place, 9.0))
            .sum();
        let lookup_ns = started.elapsed().as_nanos() as f64 / f64::from(asked);
        println!(
            "{name}: {built:?}, {} streets, {:.0} m driven, {:.0} m aside, {lookup_ns:.0} ns a lookup ({sum:.0})",
            streets.streets().len(),
            length_m(&streets, true),
            length_m(&streets, false)
        );
        let worst = worst_clearance(&drive, drive.duration_s(), &streets);
        assert!(worst < -1.2, "{worst}");
        assert!(built.as_secs_f64() < 2.0);
    }
}
