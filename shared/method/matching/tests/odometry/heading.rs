//! A log of absolute headings beside a radar whose heading drifts.

use std::fs;

use gyre_datasets::{ScanSamples, open_source};
use gyre_geometry::{
    OwnedScan,
    samples::{SampleKind, SensorKind, Witness},
    wrap_angle,
};
use gyre_matching::{
    Verdict,
    odometry::{Odometry, OdometryConfig},
};
use gyre_simulator::{SimulatedDrive, SimulationConfig};

/// The heading of a drive.
struct Driven {
    /// Error of the heading at the end against the heading at the begin, RMS of ten scans, rad.
    end_rad: f64,
    used: usize,
    refused: usize,
}

/// Drives around a block with a coarse radar, and with a log of these headings, rad, of antennas
/// that are mounted across the vehicle; `None`: without a log.
fn drive(scans: usize, logged: Option<fn(f64) -> f64>) -> Driven {
    let mut simulation = SimulationConfig {
        scans: Some(scans),
        ..SimulationConfig::default()
    };
    let sensor = &mut simulation.sensor;
    (sensor.azimuths, sensor.bins) = (Some(200), Some(800));
    sensor.beam_deg = Some(3.0);
    simulation.heading.rate_hz = 20.0;
    simulation.heading.noise_deg = 0.1;
    simulation.heading.offset_deg = 90.0;
    let drive = SimulatedDrive::new(&simulation).unwrap();
    let options = simulation.dataset_options();
    let mut dataset = open_source(Box::new(drive.renderer()), &options).unwrap();
    let mut config = OdometryConfig::default();
    config.sensors.heading.noise_deg = 0.1;
    let folder = tempfile::tempdir().unwrap();
    if let Some(logged) = logged {
        let samples = drive.samples(SampleKind::Heading).unwrap();
        let rows = samples.iter().map(|it| {
            let clockwise_deg = 90.0 - logged(it.values[0]).to_degrees();
            format!("{},{}\n", it.stamp_ns, clockwise_deg.rem_euclid(360.0))
        });
        let text: String = ["stamp_ns,heading_deg\n".to_owned()]
            .into_iter()
            .chain(rows)
            .collect();
        fs::write(folder.path().join("heading.csv"), text).unwrap();
        config.sensors.heading.kind = SensorKind::Auto;
    }
    let sensors = config.sensors.sampled();
    let samples = ScanSamples::open(&sensors, folder.path(), dataset.as_mut()).unwrap();
    assert!(samples.faults().is_empty(), "{:?}", samples.faults());
    let mut odometry = Odometry::new(&config).unwrap();
    let mut scan = OwnedScan::with_limits(dataset.limits());
    let begin = drive.simulator().pose(0);
    let (mut errors, mut verdicts) = (Vec::new(), Vec::new());
    for index in 0..scans {
        scan.geometry = dataset.read(index, scan.slot()).unwrap();
        let view = scan.view();
        let of_scan = samples.of(dataset.as_ref(), view.span_ns());
        let registered = odometry.register(&view, &of_scan).unwrap();
        let truth = begin.inv_mul(&drive.simulator().pose(index));
        let off = truth.rotation.rotation_to(&registered.pose.motion.rotation);
        errors.push(wrap_angle(off.angle()));
        let witnesses = registered.refined.map(|it| it.witnesses);
        verdicts.extend(witnesses.and_then(|it| it[Witness::Heading as usize]));
    }
    let squares = errors[scans - 10..].iter().map(|it| it * it).sum::<f64>();
    let count = |verdict| verdicts.iter().filter(|it| it.verdict == verdict).count();
    Driven {
        end_rad: (squares / 10.0).sqrt(),
        used: count(Verdict::Agrees),
        refused: count(Verdict::Refused),
    }
}

#[test]
fn a_heading_bounds_the_drift_of_the_radar() {
    let [alone, with] = [None, Some((|it| it) as fn(f64) -> f64)].map(|it| drive(400, it));
    assert_eq!((alone.used, alone.refused), (0, 0));
    assert!(with.used > 390, "{} {}", with.used, with.refused);
    let [with, alone] = [with.end_rad, alone.end_rad].map(f64::to_degrees);
    assert!(with < 0.5 * alone, "{with} {alone}");
}

#[test]
fn a_heading_that_turns_the_other_way_is_refused_and_changes_little() {
    let [alone, with] = [None, Some((|it| -it) as fn(f64) -> f64)].map(|it| drive(100, it));
    assert!(with.refused > 50, "{} {}", with.used, with.refused);
    let [with, alone] = [with.end_rad, alone.end_rad].map(f64::to_degrees);
    assert!((with - alone).abs() < 0.3, "{with} {alone}");
}
