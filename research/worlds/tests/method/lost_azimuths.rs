//! Azimuths that the host has lost, in simulated recordings of RADIATE.

use gyre_datasets::{DatasetOptions, LostAzimuthOption, open_source};
use gyre_geometry::{Pose, LostAzimuths, OwnedScan};
use gyre_matching::odometry::{Odometry, OdometryConfig};
use gyre_radar::PlacedRows;
use gyre_worlds::{OutputFormat, Profile, SimulatedDrive, SimulationConfig};

const SCANS: usize = 60;
/// Motions at the start that the local map is too young for.
const FIRST: usize = 3;

fn drive(seed: u64, loses: bool) -> SimulatedDrive {
    let mut config = SimulationConfig {
        scans: Some(SCANS),
        seed,
        ..SimulationConfig::default()
    };
    config.sensor.profile = Profile::Cts350xRadiate;
    config.output.format = Some(OutputFormat::Radiate);
    config.drive.speed_mps = 5.0;
    config.effects.lost_azimuths = Some(loses);
    SimulatedDrive::new(&config).unwrap()
}

fn scans(drive: &SimulatedDrive, lost_azimuths: LostAzimuthOption) -> Vec<OwnedScan> {
    let options = DatasetOptions {
        lost_azimuths: Some(lost_azimuths),
        ..drive.dataset_options()
    };
    let mut dataset = open_source(Box::new(drive.renderer()), &options).unwrap();
    let read = |index| {
        let mut scan = OwnedScan::with_limits(dataset.limits());
        scan.geometry = dataset.read(index, scan.slot()).unwrap();
        scan
    };
    (0..drive.scans()).map(read).collect()
}

/// Motion of the simulated radar from the scan before.
fn motion(drive: &SimulatedDrive, index: usize) -> Pose {
    let simulator = drive.simulator();
    simulator.pose(index - 1).inv_mul(&simulator.pose(index))
}

/// The rows before which azimuths of a scan were lost.
fn rows_before_which(drive: &SimulatedDrive, index: usize) -> Vec<usize> {
    let azimuths = drive.lost_azimuths(index).into_iter().enumerate();
    azimuths.map(|(before, azimuth)| azimuth - before).collect()
}

/// RMS errors of motions, m: with places that are known, found, and ignored, and of scans that have
/// lost none.
fn errors_m(seed: u64) -> [f64; 4] {
    let rms_m = |loses: bool, option: LostAzimuthOption, known: bool| {
        let drive = drive(seed, loses);
        let mut odometry = Odometry::new(&OdometryConfig::default()).unwrap();
        let mut rows = PlacedRows::default();
        let mut square_m2 = 0.0;
        for (index, scan) in scans(&drive, option).iter().enumerate() {
            let scan = scan.view();
            let places = rows_before_which(&drive, index).into_iter();
            let known = LostAzimuths::between(places.filter(|_| known).map(|row| [row as u16; 2]));
            let registered = odometry.register(&rows.place(&scan, &known), &[]).unwrap();
            if index >= FIRST {
                let off = motion(&drive, index).inv_mul(&registered.motion.motion);
                square_m2 += off.translation.vector.norm_squared();
            }
        }
        (square_m2 / (SCANS - FIRST) as f64).sqrt()
    };
    let find = LostAzimuthOption::Find;
    [
        rms_m(true, find, true),
        rms_m(true, find, false),
        rms_m(true, LostAzimuthOption::Ignore, false),
        rms_m(false, find, false),
    ]
}

#[test]
#[ignore = ".ci/nightly: four drives"]
fn motions_are_as_good_as_without_losses_where_the_places_are_known_and_better_where_found() {
    assert_as_good(errors_m(2));
}

#[test]
#[ignore = ".ci/nightly: twelve drives"]
fn motions_of_several_drives_are_as_good_as_without_losses() {
    let mut means_m = [0.0; 4];
    for seed in 1..4 {
        for (mean_m, error_m) in means_m.iter_mut().zip(errors_m(seed)) {
            *mean_m += error_m / 3.0;
        }
    }
    assert_as_good(means_m);
}

fn assert_as_good([known_m, found_m, ignored_m, none_lost_m]: [f64; 4]) {
    println!(
        "known {known_m:.4} m, found {found_m:.4}, ignored {ignored_m:.4}, none lost {none_lost_m:.4}"
    );
    assert!(known_m < 1.02 * none_lost_m, "{known_m} m");
    assert!(found_m < 0.75 * ignored_m, "{found_m} m for {ignored_m} m");
}
