//! Covariances of motions in simulated streets with exact truth, with and without lost azimuths.
//! Roads as hard as real ones are in `research/worlds/tests/method/covariances.rs`.

use std::{fs, path::Path};

use gyre_datasets::open_source;
use gyre_geometry::{ComposedMotion, OwnedScan, xy_yaw};
use gyre_matching::odometry::{Odometry, OdometryConfig};
use gyre_simulator::{SimulatedDrive, SimulationConfig};
use nalgebra::Vector3;

const PROJECT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../../..");
const SCANS: usize = 60;
/// Motions at the start that the local map is too young for.
const FIRST: usize = 8;
const SEEDS: [u64; 2] = [4, 5];

/// For a motion: whether its scans `[earlier, later]` have lost azimuths, its squared error over
/// its covariance, and its stated variance of the yaw, rad².
type Motion = ([bool; 2], f64, f64);

/// The motions of all drives. They go straight on: where a vehicle turns into a side street, places
/// of lost azimuths are found wrongly, since the motion of two scans earlier predicts them.
fn motions() -> Vec<Motion> {
    let text = fs::read_to_string(Path::new(PROJECT).join("configs/radiate.toml")).unwrap();
    let config: OdometryConfig = toml::from_str(&text).unwrap();
    let mut motions = Vec::new();
    for seed in SEEDS {
        let simulation = format!(
            "scans = {SCANS}
            seed = {seed}
            sensor = {{ profile = 'cts350x-radiate', lost_azimuths = true }}
            output.format = 'radiate'
            drive.file = '{PROJECT}/configs/stop-and-go.tum'"
        );
        let simulation: SimulationConfig = toml::from_str(&simulation).unwrap();
        let drive = SimulatedDrive::new(&simulation).unwrap();
        let mut dataset =
            open_source(Box::new(drive.renderer()), &drive.dataset_options()).unwrap();
        let mut odometry = Odometry::new(&config).unwrap();
        let mut scan = OwnedScan::with_limits(dataset.limits());
        for index in 0..SCANS {
            scan.geometry = dataset.read(index, scan.slot()).unwrap();
            let registered = odometry.register(&scan.view(), &[]).unwrap();
            if index < FIRST {
                continue;
            }
            let [from, to] = [index - 1, index].map(|index| drive.simulator().pose(index));
            let lost = [index - 1, index].map(|index| !drive.lost_azimuths(index).is_empty());
            let stated = ComposedMotion::of(&registered.motion).motion;
            let truth = Vector3::from(xy_yaw(&from.inv_mul(&to)));
            let error = Vector3::from(xy_yaw(&stated.motion)) - truth;
            let squared = error.dot(&stated.covariance.cholesky().unwrap().solve(&error));
            motions.push((lost, squared, stated.covariance[(2, 2)]));
        }
    }
    motions
}

#[test]
fn motions_err_at_most_as_stated_and_lost_azimuths_widen_those_to_and_from_their_scan() {
    let motions = motions();
    let mean = |value: fn(&Motion) -> f64, kinds: &[[bool; 2]]| {
        let of_kinds = motions.iter().filter(|(lost, ..)| kinds.contains(lost));
        let values: Vec<f64> = of_kinds.map(value).collect();
        values.iter().sum::<f64>() / values.len() as f64
    };
    let [neither, later, earlier] = [[false, false], [false, true], [true, false]];
    // Streets are easier than the roads on which the scales of covariances were set.
    for kinds in [&[neither][..], &[neither, later, earlier, [true, true]]] {
        let nees = mean(|(_, squared, _)| squared / 3.0, kinds);
        assert!((0.1..1.5).contains(&nees), "{nees}");
    }
    // An azimuth whose place is not known widens the motion to its scan and the one from it, which
    // takes the error back, and no other.
    let yaw_sigma_deg = |lost| {
        mean(|(.., variance)| *variance, &[lost])
            .sqrt()
            .to_degrees()
    };
    let [least_deg, to_deg, from_deg] = [neither, later, earlier].map(yaw_sigma_deg);
    assert!(
        to_deg.min(from_deg) > 1.2 * least_deg && (0.7..1.4).contains(&(to_deg / from_deg)),
        "{least_deg}, {to_deg}, {from_deg}"
    );
}
