//! Covariances of motions on simulated roads, whose truth is exact, with and without lost azimuths.

use std::{fs, path::Path};

use gyre_datasets::open_source;
use gyre_geometry::{ComposedMotion, Pose, UncertainMotion, xy_yaw, OwnedScan};
use gyre_matching::odometry::{Odometry, OdometryConfig};
use gyre_worlds::{SimulatedDrive, SimulationConfig};
use nalgebra::{Matrix3, Vector3};

const PROJECT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../..");
const SCANS: usize = 60;
/// Motions at the start that the local map is too young for.
const FIRST: usize = 8;
const SEEDS: [u64; 2] = [4, 5];

/// Straight on. Where a vehicle turns into a side street, places of lost azimuths are found
/// wrongly, since the motion of two scans earlier predicts them.
fn drive(seed: u64) -> SimulatedDrive {
    let text = format!(
        "scans = {SCANS}
        seed = {seed}
        realism = 'road'
        sensor.profile = 'cts350x-radiate'
        output.format = 'radiate'
        drive = {{ kind = 'file', file = '{PROJECT}/configs/stop-and-go.tum' }}"
    );
    let config: SimulationConfig = toml::from_str(&text).unwrap();
    SimulatedDrive::new(&config).unwrap()
}

/// Sums over motions of one kind.
#[derive(Debug, Default)]
struct Sums {
    motions: usize,
    /// NEES, whose expectation is 3.
    squared: f64,
    /// Stated variance of the yaw, rad².
    yaw_variance_rad2: f64,
}

impl Sums {
    fn add(&mut self, covariance: &Matrix3<f64>, error: &Vector3<f64>) {
        self.motions += 1;
        self.squared += error.dot(&covariance.cholesky().unwrap().solve(error));
        self.yaw_variance_rad2 += covariance[(2, 2)];
    }

    fn nees(&self) -> f64 {
        self.squared / (3 * self.motions) as f64
    }

    fn yaw_sigma_deg(&self) -> f64 {
        (self.yaw_variance_rad2 / self.motions as f64)
            .sqrt()
            .to_degrees()
    }
}

fn error(estimate: &Pose, truth: &Pose) -> Vector3<f64> {
    let [x, y, yaw] = xy_yaw(estimate);
    let [true_x, true_y, true_yaw] = xy_yaw(truth);
    Vector3::new(x - true_x, y - true_y, yaw - true_yaw)
}

/// The motions of all drives whose `[earlier, later]` scan has lost azimuths.
fn motions() -> Vec<([bool; 2], UncertainMotion, Pose)> {
    let text = fs::read_to_string(Path::new(PROJECT).join("configs/radiate.toml")).unwrap();
    let config: OdometryConfig = toml::from_str(&text).unwrap();
    let mut motions = Vec::new();
    for seed in SEEDS {
        let drive = drive(seed);
        let mut dataset =
            open_source(Box::new(drive.renderer()), &drive.dataset_options()).unwrap();
        let mut odometry = Odometry::new(&config).unwrap();
        let mut scan = OwnedScan::with_limits(dataset.limits());
        for index in 0..SCANS {
            scan.geometry = dataset.read(index, scan.slot()).unwrap();
            let registered = odometry.register(&scan.view(), &[]).unwrap();
            if index >= FIRST {
                let at = |index| drive.simulator().pose(index);
                let lost = [index - 1, index].map(|index| !drive.lost_azimuths(index).is_empty());
                let stated = ComposedMotion::of(&registered.motion).motion;
                motions.push((lost, stated, at(index - 1).inv_mul(&at(index))));
            }
        }
    }
    motions
}

#[test]
fn motions_on_roads_err_as_stated_to_and_from_a_scan_with_lost_azimuths() {
    let [mut all, mut neither, mut later, mut earlier] = <[Sums; 4]>::default();
    for (lost, stated, truth) in motions() {
        let error = error(&stated.motion, &truth);
        all.add(&stated.covariance, &error);
        match lost {
            [false, false] => neither.add(&stated.covariance, &error),
            [false, true] => later.add(&stated.covariance, &error),
            [true, false] => earlier.add(&stated.covariance, &error),
            [true, true] => {}
        }
    }
    println!("{all:.2?}, {neither:.2?}, {later:.2?}, {earlier:.2?}");
    assert!((0.45..1.5).contains(&all.nees()), "{}", all.nees());
    assert!((0.5..2.0).contains(&neither.nees()), "{}", neither.nees());
    // An azimuth whose place is not known widens the motion to its scan and the one from it, which
    // takes the error back, and no other.
    let least_deg = 1.5 * neither.yaw_sigma_deg();
    let [to_deg, from_deg] = [later.yaw_sigma_deg(), earlier.yaw_sigma_deg()];
    assert!(to_deg.min(from_deg) > least_deg, "{to_deg}, {from_deg}");
    assert!(
        (0.7..1.4).contains(&(to_deg / from_deg)),
        "{to_deg}, {from_deg}"
    );
}
