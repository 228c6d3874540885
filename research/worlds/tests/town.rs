//! Towns along whole drives: free carriageways, and a size that can be rendered.

use crate::common::lap_s;
use gyre_worlds::body::NO_BODY;
use gyre_worlds::path::recorded::{Excerpt, read};
use gyre_worlds::town::{self, TownConfig};
use gyre_worlds::{BlockLoop, DrivingSide, Path, Streets, World};
use nalgebra::Point2;

/// Maximum range of the radars, metres.
const REACH_M: f64 = 165.0;

fn place(drive: &dyn Path, time_s: f64) -> Point2<f64> {
    Point2::from(drive.pose(time_s).translation.vector)
}

/// Builds the town along a drive and checks that nothing stands on a street or between two places
/// of the drive.
fn free_town(drive: &dyn Path, duration_s: f64, seed: u64, config: &TownConfig) -> World {
    let streets = Streets::along(drive, duration_s, DrivingSide::Left, seed);
    let world = World::new(town::build(config, &streets, seed));
    for scatterer in world.scatterers() {
        assert!(
            streets.clearance_m(scatterer.position, 1.0) > 0.0,
            "seed {seed}: {scatterer:?}"
        );
    }
    for step in 0..(duration_s / 0.5) as usize {
        let [from, to] = [0.0, 0.5].map(|later| place(drive, 0.5 * step as f64 + later));
        assert_eq!(
            world.transmission(from, to, NO_BODY, 0.0),
            1.0,
            "seed {seed}: a wall across the drive at {from}"
        );
    }
    world
}

#[test]
fn a_loop_of_streets_is_free() {
    let drive = BlockLoop::new(90.0, 60.0, 9.5, 5.0);
    for seed in 0..6 {
        let world = free_town(&drive, lap_s(&drive), seed, &TownConfig::default());
        assert!(
            world.scatterers().len() > 4_000,
            "seed {seed}: {}",
            world.scatterers().len()
        );
    }
}

#[test]
fn belts_leave_the_streets_free_and_hide_what_is_beside_them() {
    let drive = BlockLoop::new(90.0, 60.0, 9.5, 5.0);
    let belts = |share| TownConfig {
        belts: share,
        ..TownConfig::default()
    };
    // Share of the views to both sides of the drive in which less than a third passes.
    let closed = |config: &TownConfig| {
        let world = free_town(&drive, lap_s(&drive), 3, config);
        let hidden = |step: usize, side: f64| {
            let pose = drive.pose(lap_s(&drive) * step as f64 / 200.0);
            let from = Point2::from(pose.translation.vector);
            let to = pose * Point2::new(0.0, side * 35.0);
            world.transmission(from, to, NO_BODY, 0.0) < 0.3
        };
        let hidden = (0..400).filter(|view| hidden(view / 2, [-1.0, 1.0][view % 2]));
        hidden.count() as f64 / 400.0
    };
    let (none, half, all) = (
        closed(&belts(None)),
        closed(&belts(Some(0.5))),
        closed(&belts(Some(1.0))),
    );
    assert!(
        all > 0.6 && all > half && half > none,
        "{none}, {half}, {all}"
    );
}

#[test]
#[ignore = ".ci/nightly: whole drives"]
fn real_drives_have_free_streets_and_towns_of_a_reasonable_size() {
    let Some(data) = std::env::var_os("GYRE_DATA") else {
        println!("skipped: GYRE_DATA is not set");
        return;
    };
    let trajectories = std::path::Path::new(&data).join("trajectories");
    for file in [
        "oxford-2019-01-10-11-46-21.radar_odometry.csv",
        "boreas-2021-09-02-11-42-radar_poses.csv",
    ] {
        let drive = read(&trajectories.join(file), Excerpt::default()).unwrap();
        for seed in 1..4 {
            let world = free_town(&drive, drive.duration_s(), seed, &TownConfig::default());
            let all = world.scatterers().len();
            assert!(
                (200_000..2_000_000).contains(&all),
                "{file}, seed {seed}: {all} scatterers"
            );
            let near = |time_s: f64| {
                let centre = place(&drive, time_s);
                world
                    .scatterers()
                    .iter()
                    .filter(|s| (s.position - centre).norm() < REACH_M)
                    .count()
            };
            let most = (0..20)
                .map(|share| near(drive.duration_s() * f64::from(share) / 20.0))
                .max()
                .unwrap();
            assert!(
                (20_000..75_000).contains(&most),
                "{file}, seed {seed}: {most} scatterers in sight"
            );
            println!("{file}, seed {seed}: {all} scatterers, at most {most} in sight");
        }
    }
}
