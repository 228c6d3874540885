//! Azimuths that the host has lost, in simulated recordings of RADIATE. The errors of motions are
//! compared in `research/worlds/tests/method/lost_azimuths.rs`.

use gyre_datasets::{DatasetOptions, LostAzimuthOption, open_source};
use gyre_geometry::{Pose, Twist};
use gyre_radar::{LostAzimuthFinder, OwnedScan, lost::stale_rows};
use gyre_simulator::{OutputFormat, Profile, SimulatedDrive, SimulationConfig};

const SCANS: usize = 60;

fn drive(seed: u64) -> SimulatedDrive {
    let mut config = SimulationConfig {
        scans: Some(SCANS),
        seed,
        ..SimulationConfig::default()
    };
    config.sensor.profile = Profile::Cts350xRadiate;
    config.output.format = Some(OutputFormat::Radiate);
    config.drive.speed_mps = 5.0;
    config.sensor.lost_azimuths = true;
    SimulatedDrive::new(&config).unwrap()
}

fn scans(drive: &SimulatedDrive) -> Vec<OwnedScan> {
    let options = DatasetOptions {
        lost_azimuths: Some(LostAzimuthOption::Find),
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

#[test]
fn all_are_counted_and_lie_where_they_are_said_to_be() {
    let (mut places, mut within, mut rows) = (0, 0, 0);
    for seed in 1..3 {
        let drive = drive(seed);
        let mut finder = LostAzimuthFinder::default();
        for (index, scan) in scans(&drive).iter().enumerate() {
            let lost = rows_before_which(&drive, index);
            assert_eq!(stale_rows(&scan.view()), lost.len(), "scan {index}");
            // As in a pipeline, the motion of two scans earlier.
            let twist = (index > 2).then(|| {
                let interval_s = drive.simulator().time(index).period_us as f64 * 1e-6;
                Twist::from_motion(&motion(&drive, index - 2), interval_s)
            });
            let found = finder.find(&scan.view(), twist);
            for (row, [first, last, _]) in lost.iter().zip(found.gaps()) {
                places += 1;
                // The interval has the mean and the variance of the place, not all of it.
                let (first, last) = (usize::from(*first), usize::from(*last));
                within += usize::from((first.saturating_sub(4)..=last + 4).contains(row));
                rows += last + 1 - first;
            }
        }
    }
    println!(
        "{within} of {places} within, of {} rows in the mean",
        rows / places
    );
    assert!(places > 40);
    assert!(within * 10 >= places * 7, "{within} of {places}");
    assert!(rows < places * 150, "{rows} rows for {places} places");
}
