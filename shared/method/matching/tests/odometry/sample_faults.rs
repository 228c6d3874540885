//! Faults in the samples of a gyro and of wheels: each leaves the motions unchanged, or a run
//! counts and names it in its report about samples and motions. One kind of faults lasts for a
//! sweep or more, the other for less: a third for one sample, a third for up to five.

use std::collections::BTreeMap;

use gyre_datasets::{Dataset, SampleLog, ScanSamples, open_source};
use gyre_geometry::{
    OwnedScan, Pose, SparsePoint,
    samples::{AllEvidence, Sample, SampleKind, SampledSensors, SensorKind, Witness},
    xy_yaw,
};
use gyre_matching::{
    Refiner, Searched,
    odometry::{Odometry, OdometryConfig},
};
use gyre_simulator::{GyroProfile, SimulatedDrive, SimulationConfig};

use crate::common::Numbers;

/// A drive that was masked and searched once: what refinement gets, scan by scan.
struct Drive {
    dataset: Box<dyn Dataset>,
    config: OdometryConfig,
    scans: Vec<Scan>,
    gyro: Vec<Sample>,
    wheels: Vec<Sample>,
    folder: tempfile::TempDir,
}

struct Scan {
    stamp_ns: i64,
    span_ns: [i64; 2],
    points: Vec<SparsePoint>,
    searched: Pose,
}

/// The motions, and the whole report of a run about its samples and motions.
#[derive(Debug, PartialEq)]
struct Ran {
    motions: Vec<[u64; 3]>,
    named: Vec<String>,
}

impl Drive {
    fn new(scans: usize) -> Self {
        let mut simulation = SimulationConfig {
            scans: Some(scans),
            ..SimulationConfig::default()
        };
        simulation.gyro.profile = GyroProfile::Asm330lhh;
        simulation.wheels.rate_hz = 50.0;
        let drive = SimulatedDrive::new(&simulation).unwrap();
        let mut dataset =
            open_source(Box::new(drive.renderer()), &simulation.dataset_options()).unwrap();
        let mut config = OdometryConfig::default();
        let mut odometry = Odometry::new(&config).unwrap();
        let mut scan = OwnedScan::with_limits(dataset.limits());
        let registered = |index| {
            scan.geometry = dataset.read(index, scan.slot()).unwrap();
            let view = scan.view();
            let registered = odometry.register(&view, &[]).unwrap();
            Scan {
                stamp_ns: view.geometry.stamp_ns,
                span_ns: view.span_ns(),
                points: odometry.points().to_vec(),
                searched: registered
                    .searched
                    .map_or(Pose::identity(), |it| it.motion.pose()),
            }
        };
        let scans = (0..scans).map(registered).collect();
        let sensors = &mut config.sensors;
        (sensors.gyro.kind, sensors.wheels.kind) = (SensorKind::Auto, SensorKind::Auto);
        Self {
            scans,
            dataset,
            config,
            gyro: drive.samples(SampleKind::Gyro).unwrap(),
            wheels: drive.samples(SampleKind::Wheels).unwrap(),
            folder: tempfile::tempdir().unwrap(),
        }
    }

    /// Reads both logs and refines all motions; rejected samples are named only by the message.
    fn run(&self, gyro: &[Sample], wheels: &[Sample]) -> Ran {
        match self.read(gyro, wheels) {
            Ok(samples) => self.refine(&samples),
            Err(refusal) => Ran {
                motions: Vec::new(),
                named: vec![refusal],
            },
        }
    }

    fn read(&self, gyro: &[Sample], wheels: &[Sample]) -> Result<ScanSamples, String> {
        let write = |name: &str, header: &str, rows: &[Sample]| {
            let rows = rows.iter().map(line);
            let text: String = [header.to_owned()].into_iter().chain(rows).collect();
            let path = self.folder.path().join(name);
            std::fs::write(&path, text).unwrap();
            path
        };
        let gyro = write(
            "imu.csv",
            "stamp_ns,gyro_x_radps,gyro_y_radps,gyro_z_radps\n",
            gyro,
        );
        let wheels = write("wheels.csv", "stamp_ns,speed_m_s\n", wheels);
        let dataset = self.dataset.as_ref();
        let files = [gyro, wheels];
        let mut sensors = self.config.sensors.sampled().into_iter().zip(&files);
        sensors.try_fold(ScanSamples::None, |all, (sensor, file)| {
            let samples = SampleLog::read(sensor.of(), file, None)
                .and_then(|log| ScanSamples::of_log(&log, sensor, dataset));
            Ok(all.and(samples.map_err(|error| error.to_string())?))
        })
    }

    fn refine(&self, samples: &ScanSamples) -> Ran {
        let config = &self.config;
        let capacity = config.points.capacity;
        let mut refiner = Refiner::new(&config.refinement, &config.sensors, capacity).unwrap();
        let mut sensors = SampledSensors::new(&config.sensors);
        let mut counts: BTreeMap<String, u32> = BTreeMap::new();
        let mut motions = Vec::new();
        for (k, scan) in self.scans.iter().enumerate() {
            let of = samples.of(self.dataset.as_ref(), scan.span_ns);
            sensors.push(&of, scan.stamp_ns, scan.span_ns);
            let Some(before) = k.checked_sub(1).map(|k| &self.scans[k]) else {
                continue;
            };
            let interval_s = (scan.stamp_ns - before.stamp_ns) as f64 * 1e-9;
            let (later, earlier) = (&scan.points, &before.points);
            let motion = &scan.searched;
            let refined = refiner.refine(&Searched {
                evidence: [&AllEvidence::default(), &sensors.evidence()],
                ..Searched::by_radar(k as u64, later, earlier, motion, interval_s)
            });
            motions.push(xy_yaw(&refined.motion.motion).map(f64::to_bits));
            let verdicts = refined.witnesses.map(|it| it.map(|it| it.verdict));
            let verdicts = Witness::ALL
                .iter()
                .zip(verdicts)
                .map(|it| format!("{it:?}"));
            for counted in verdicts.chain([format!("{:?}", refined.outcome)]) {
                *counts.entry(counted).or_default() += 1;
            }
        }
        let named = counts.iter().map(|(what, count)| format!("{what} {count}"));
        Ran {
            motions,
            named: named.chain(samples.faults().iter().cloned()).collect(),
        }
    }
}

/// The number of values of a sample in a row of its log; the last one is the yaw rate or the speed.
fn values(sample: &Sample) -> usize {
    if sample.is(SampleKind::Gyro) { 3 } else { 1 }
}

fn line(sample: &Sample) -> String {
    let values = sample.values[..values(sample)].iter();
    let values: String = values.map(|value| format!(",{value}")).collect();
    format!("{}{values}\n", sample.stamp_ns)
}

fn last(sample: &mut Sample) -> &mut f64 {
    let count = values(sample);
    &mut sample.values[count - 1]
}

const KINDS: [&str; 7] = [
    "lost",
    "late",
    "repeated",
    "out of order",
    "nan",
    "jump",
    "unit",
];

const SWEEP: [usize; 2] = [26, 13];

/// Draws a number of samples of a gyro (0) or of wheels (1): a sweep of samples or more, or
/// fewer samples.
fn length(is_long: bool, sensor: usize, seed: u64, numbers: &mut Numbers) -> usize {
    let sweep = SWEEP[sensor];
    match (is_long, seed / 14 % 3) {
        (true, _) => sweep + numbers.below(94 / (1 + sensor)),
        (false, 0) => 1,
        (false, 1) => 1 + numbers.below(5),
        (false, _) => 1 + numbers.below(sweep - 1),
    }
}

/// Puts a fault of a kind into so many rows of a log, which is of a gyro or of wheels.
fn spoil(rows: &mut Vec<Sample>, kind: &str, is_gyro: bool, count: usize, numbers: &mut Numbers) {
    let from = numbers.below(rows.len() - count);
    let stretch = from..from + count;
    match kind {
        "lost" => drop(rows.drain(stretch)),
        "late" => {
            let late_ns = 1_000_000 * (50 + numbers.below(2000) as i64);
            rows[stretch]
                .iter_mut()
                .for_each(|row| row.stamp_ns += late_ns);
        }
        "repeated" => {
            let again = rows[stretch.clone()].to_vec();
            rows.splice(stretch.end..stretch.end, again);
        }
        "out of order" => rows[stretch].reverse(),
        "nan" => rows[stretch]
            .iter_mut()
            .for_each(|row| *last(row) = f64::NAN),
        "jump" => {
            let (least, wide) = if is_gyro { (0.5, 80) } else { (3.0, 500) };
            let by = least + 0.1 * numbers.below(wide) as f64;
            let by = if numbers.below(2) == 0 { by } else { -by };
            rows[stretch].iter_mut().for_each(|row| *last(row) += by);
        }
        _ => {
            let factor = if is_gyro { 57.295_779_5 } else { 3.6 };
            rows.iter_mut().for_each(|row| {
                row.values.iter_mut().for_each(|value| *value *= factor);
            });
        }
    }
}

/// Draws so many faults, and checks that each that changes a motion is named.
fn faults(drive: &Drive, count: u64, is_long: bool) {
    let logs = [drive.gyro.clone(), drive.wheels.clone()];
    let good = drive.run(&logs[0], &logs[1]);
    assert_eq!(good.motions.len(), drive.scans.len() - 1, "{good:?}");
    for seed in 0..count {
        let mut numbers = Numbers(seed);
        let kind = KINDS[(seed as usize) % KINDS.len()];
        let sensor = seed as usize / KINDS.len() % 2;
        let mut spoilt = logs.clone();
        let samples = length(is_long, sensor, seed, &mut numbers);
        spoil(
            &mut spoilt[sensor],
            kind,
            sensor == 0,
            samples,
            &mut numbers,
        );
        let ran = drive.run(&spoilt[0], &spoilt[1]);
        assert!(
            ran.motions == good.motions || ran.named != good.named,
            "seed {seed}, {kind}, {samples} samples of sensor {sensor}: silent"
        );
    }
}

#[test]
fn no_fault_of_samples_changes_a_motion_silently() {
    let drive = Drive::new(16);
    faults(&drive, 28, true);
    faults(&drive, 42, false);
}

#[test]
#[ignore = ".ci/nightly: 616 faults, each with the refinement of 40 scans"]
fn no_fault_of_many_changes_a_motion_silently() {
    let drive = Drive::new(40);
    faults(&drive, 308, true);
    faults(&drive, 308, false);
}
