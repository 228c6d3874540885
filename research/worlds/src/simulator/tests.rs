#![allow(clippy::unwrap_used)]
use std::f64::consts::PI;
use std::fs::File;
use std::path::Path as FilePath;

use gyre_radar::Trajectory;

use super::*;
use crate::body::{Movers, Wall};
use crate::drive::DriveConfig;
use crate::path::TownDrive;
use crate::town::{ParkedCar, TownConfig};

/// Writes a drive of some 80 s and the way back in the other lane: `out.tum`, `back.tum`.
fn trajectories(folder: &FilePath) -> Vec<PathBuf> {
    let drive = TownDrive {
        length_m: 500.0,
        speed_mps: 9.0,
        lateral_acceleration_mps2: 2.2,
        driving_side: crate::DrivingSide::Left,
    }
    .path(8);
    let times = (0..(4.0 * drive.duration_s()) as usize).map(|index| index as f64 / 4.0);
    let out: Vec<Pose> = times.map(|time_s| drive.pose(time_s)).collect();
    // Away from the origin, as a recorded drive may begin anywhere.
    let origin = gyre_geometry::pose(7000.0, -300.0, 0.4);
    let opposite = gyre_geometry::pose(0.0, -crate::lanes::LANE_M, PI);
    let back = out.iter().rev().map(|pose| origin * pose * opposite);
    let files = ["out.tum", "back.tum"].map(|name| folder.join(name));
    write(&files[0], out.iter().map(|pose| origin * pose).collect());
    write(&files[1], back.collect());
    files.to_vec()
}

fn write(file: &FilePath, poses: Vec<Pose>) {
    let stamps =
        (0..poses.len()).map(|index| 1_500_000_000_000_000_000 + index as i64 * 250_000_000);
    let trajectory = Trajectory {
        stamp_ns: Some(stamps.collect()),
        poses,
    };
    gyre_datasets::write_tum(&trajectory, &mut File::create(file).unwrap()).unwrap();
}

/// The drive along a file through the town of all files.
fn through(files: &[PathBuf], driven: usize) -> SimulationConfig {
    SimulationConfig {
        drive: DriveConfig::along_file(files[driven].clone()),
        town: TownConfig {
            seed: Some(5),
            streets: files.to_vec(),
            ..TownConfig::default()
        },
        ..SimulationConfig::default()
    }
}

/// A simulator of the default configuration with changes.
fn with(change: impl FnOnce(&mut SimulationConfig)) -> Simulator {
    let mut config = SimulationConfig::default();
    change(&mut config);
    Simulator::new(&config).unwrap()
}

/// The ends of the walls that let a share of power within a range pass.
fn walls(
    simulator: &Simulator,
    transmission: std::ops::Range<f64>,
) -> Vec<(Point2<f64>, Point2<f64>)> {
    let walls = simulator.world.walls().iter();
    walls
        .filter(|wall| transmission.contains(&wall.transmission))
        .map(|&Wall { from, to, .. }| (from, to))
        .collect()
}

fn buildings(simulator: &Simulator) -> Vec<(Point2<f64>, Point2<f64>)> {
    walls(simulator, 0.0..0.2)
}

fn parked_cars(simulator: &Simulator) -> Vec<(Point2<f64>, Point2<f64>)> {
    walls(simulator, 0.85..0.9)
}

fn others(simulator: &Simulator) -> Vec<Point2<f64>> {
    let mut places = Vec::new();
    let everywhere = (Point2::origin(), 1e6);
    simulator
        .traffic
        .visit(20.0, everywhere.0, everywhere.1, &mut |mover| {
            places.push(Point2::from(mover.pose.translation.vector));
        });
    places
}

#[test]
fn two_drives_with_one_town_seed_pass_the_same_buildings_in_other_traffic() {
    let folder = tempfile::tempdir().unwrap();
    let files = trajectories(folder.path());
    let driven = |seed, driven, town_seed| {
        let mut config = through(&files, driven);
        (config.seed, config.town.seed) = (seed, Some(town_seed));
        Simulator::new(&config).unwrap()
    };
    let (out, back) = (driven(1, 0, 5), driven(2, 1, 5));
    assert!(buildings(&out).len() > 500, "{}", buildings(&out).len());
    assert_eq!(buildings(&out), buildings(&back));
    assert_eq!(out.world.scatterers(), back.world.scatterers());
    assert_ne!(others(&out), others(&back));
    assert_ne!(
        out.render_scan(0).scan.bytes,
        back.render_scan(0).scan.bytes
    );

    // Both are in one frame: the way back ends where the way out begins, one lane beside it.
    let (first, last) = (out.path.pose(0.0), back.path.pose(back.path.duration_s()));
    let lane = (first.inverse() * last).translation.vector;
    assert!((lane.norm() - crate::lanes::LANE_M).abs() < 0.3, "{lane}");
    assert!(
        first.translation.vector.norm() < 0.1,
        "the world begins with the first file"
    );

    assert_ne!(buildings(&driven(1, 0, 6)), buildings(&out));
}

#[test]
fn the_seed_of_the_town_is_that_of_the_simulation_unless_given() {
    let town = |seed, town_seed| {
        let simulator = with(|c| (c.seed, c.town.seed) = (seed, town_seed));
        simulator.world.scatterers().to_vec()
    };
    assert_eq!(town(3, None), town(4, Some(3)));
    assert_ne!(town(3, None), town(4, None));
}

#[test]
fn seeds_of_traffic_and_noise_are_apart() {
    let usual = with(|_| ());
    let traffic = with(|c| c.traffic.seed = Some(9));
    let noise = with(|c| c.sensor.seed = Some(9));
    assert_ne!(others(&usual), others(&traffic));
    assert_eq!(others(&usual), others(&noise));
    assert_ne!(
        usual.render_scan(3).scan.bytes,
        noise.render_scan(3).scan.bytes
    );
    assert_eq!(usual.world.scatterers(), noise.world.scatterers());
}

#[test]
fn parked_cars_and_building_sites_change_and_all_else_stays() {
    let changed = |changes_seed, building_sites| {
        with(|c| (c.town.changes_seed, c.town.building_sites) = (changes_seed, building_sites))
    };
    let (first, second) = (changed(None, 0.0), changed(Some(2), 0.0));
    assert_eq!(buildings(&first), buildings(&second));
    let cars = [&first, &second].map(parked_cars);
    let stayed = cars[1].iter().filter(|car| cars[0].contains(car)).count();
    let [before, after] = cars.map(|cars| cars.len());
    assert!(
        before > 100 && (0.7..1.4).contains(&(after as f64 / before as f64)),
        "{before}, {after}"
    );
    assert!(
        10 * stayed < before,
        "{stayed} of {before} cars stand as before"
    );

    let sites = changed(Some(2), 0.15);
    let (all, left) = (buildings(&second), buildings(&sites));
    let houses = left.iter().filter(|wall| all.contains(wall)).count();
    let share = houses as f64 / all.len() as f64;
    assert!(
        (0.7..0.97).contains(&share),
        "{share} of the walls are still there"
    );
    assert_ne!(
        left,
        buildings(&changed(Some(3), 0.15)),
        "other sites on the next drive"
    );
}

#[test]
fn a_parked_car_is_where_its_walls_are_and_a_building_hides_it() {
    let simulator = with(|_| ());
    let (cars, walls) = (simulator.parked_cars(), parked_cars(&simulator));
    assert_eq!(walls.len(), 2 * cars.len());
    for (car, diagonals) in cars.iter().zip(walls.chunks(2)) {
        let centre = Point2::from(car.pose.translation.vector);
        for (from, to) in diagonals {
            assert!((nalgebra::center(from, to) - centre).norm() < 1e-9);
        }
    }
    let place = simulator.pose(0).translation.vector;
    let range_m = |car: &ParkedCar| (car.pose.translation.vector - place).norm();
    let seen = |car| (range_m(car), simulator.parked_counts(car, 0));
    let seen: Vec<(f64, f64)> = cars.iter().map(seen).collect();
    // Not by the range alone: a farther one is seen.
    let is_hidden = |(range_m, counts): &(f64, f64)| {
        *counts < 60.0 && seen.iter().any(|far| far.0 > *range_m && far.1 > 80.0)
    };
    assert!(seen.iter().any(is_hidden), "{seen:?}");
}

#[test]
fn trees_without_leaves_reflect_less_and_hide_nothing() {
    let [summer, winter] = [1.0, 0.0].map(|leaves| with(|c| c.town.leaves = leaves));
    assert_eq!(buildings(&summer), buildings(&winter));
    let sum_m2 = |simulator: &Simulator| -> f64 {
        simulator
            .world
            .scatterers()
            .iter()
            .map(|s| s.cross_section_m2)
            .sum()
    };
    assert!(sum_m2(&winter) < sum_m2(&summer));
    let crowns = |simulator| walls(simulator, 0.79..0.81).len();
    assert!(crowns(&summer) > crowns(&winter) + 20, "barriers are left");
}

#[test]
fn a_recording_ends_with_its_trajectory() {
    let folder = tempfile::tempdir().unwrap();
    let files = trajectories(folder.path());
    let whole = Simulator::new(&through(&files, 0)).unwrap();
    let poses = gyre_datasets::read_trajectory(&files[0])
        .unwrap()
        .poses
        .len();
    assert!(
        whole.scans().abs_diff(poses) <= 1,
        "{} of {poses}",
        whole.scans()
    );
    let wanting = |scans| {
        Simulator::new(&SimulationConfig {
            scans: Some(scans),
            ..through(&files, 0)
        })
    };
    assert_eq!(wanting(whole.scans()).unwrap().scans(), whole.scans());
    let error = wanting(whole.scans() + 1).err().unwrap().to_string();
    assert!(
        error.contains(&format!("ends after {} scans", whole.scans())),
        "{error}"
    );
    assert_eq!(with(|_| ()).scans(), ENDLESS_SCANS);
}

#[test]
fn a_drive_off_the_streets_of_the_town_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let files = trajectories(folder.path());
    let mut config = through(&files, 0);
    let aside = gyre_datasets::read_trajectory(&files[0]).unwrap().poses;
    let aside = aside
        .iter()
        .map(|pose| pose * gyre_geometry::pose(0.0, 40.0, 0.0));
    config.drive.file = Some(folder.path().join("aside.tum"));
    write(&folder.path().join("aside.tum"), aside.collect());
    let error = Simulator::new(&config).err().unwrap().to_string();
    assert!(
        error.contains("leaves the streets of `simulation.town.streets` 0.0 s"),
        "{error}"
    );
}
