//! Faults in the samples of a gyro and of wheels: each leaves the motions unchanged, or a run
//! counts and names it in its report about samples and motions. One kind of faults lasts for a
//! sweep or more, the other for less: a third for one sample, a third for up to five.

use std::collections::BTreeMap;

use gyre_datasets::{Dataset, GyroLog, ScanSamples, WheelLog, open_source};
use gyre_geometry::{Pose, SparsePoint, xy_yaw};
use gyre_odometry::{Odometry, OdometryConfig};
use gyre_radar::OwnedScan;
use gyre_samples::{Gyro, GyroKind, Sample, SampleKind, Wheels, WheelsKind};
use gyre_scan_matching::{Outcome, Refiner, Verdict};
use gyre_simulator::{GyroProfile, SimulatedDrive, SimulationConfig};

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
        (config.gyro.kind, config.wheels.kind) = (GyroKind::Auto, WheelsKind::Auto);
        Self {
            scans,
            dataset,
            config,
            gyro: drive.gyro_samples().unwrap(),
            wheels: drive.wheel_samples().unwrap(),
            folder: tempfile::tempdir().unwrap(),
        }
    }

    /// Reads both logs and refines all motions; rejected samples are named only by the message.
    fn run(&self, gyro: &[Row], wheels: &[Row]) -> Ran {
        match self.read(gyro, wheels) {
            Ok(samples) => self.refine(&samples),
            Err(refusal) => Ran {
                motions: Vec::new(),
                named: vec![refusal],
            },
        }
    }

    fn read(&self, gyro: &[Row], wheels: &[Row]) -> Result<ScanSamples, String> {
        let write = |name: &str, header: &str, rows: &[Row]| {
            let rows = rows.iter().map(Row::line);
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
        let turns = GyroLog::read(&gyro)
            .and_then(|log| ScanSamples::of_gyro(&log, &self.config.gyro, dataset));
        let speeds = WheelLog::read(&wheels, None)
            .and_then(|log| ScanSamples::of_wheels(&log, &self.config.wheels, dataset));
        let text = |error: gyre_datasets::LogError| error.to_string();
        Ok(turns.map_err(text)?.and(speeds.map_err(text)?))
    }

    fn refine(&self, samples: &ScanSamples) -> Ran {
        let config = &self.config;
        let refiner = Refiner::new(&config.refinement, config.points.capacity).unwrap();
        let mut refiner = refiner.with_sensors(&config.gyro, &config.wheels, &config.doppler);
        let (mut gyro, mut wheels) = (Gyro::new(&config.gyro), Wheels::new(&config.wheels));
        let mut counts: BTreeMap<&str, u32> = BTreeMap::new();
        let mut motions = Vec::new();
        for (k, scan) in self.scans.iter().enumerate() {
            let of = samples.of(self.dataset.as_ref(), scan.span_ns);
            gyro.push(&of, scan.stamp_ns, scan.span_ns);
            wheels.push(&of, scan.stamp_ns, scan.span_ns);
            let Some(before) = k.checked_sub(1).map(|k| &self.scans[k]) else {
                continue;
            };
            refiner.aiding.turn = gyro.turn();
            refiner.aiding.distance = wheels.distance();
            let interval_s = (scan.stamp_ns - before.stamp_ns) as f64 * 1e-9;
            let (later, earlier) = (&scan.points, &before.points);
            let refined = refiner.refine(k as u64, later, earlier, &scan.searched, interval_s);
            motions.push(xy_yaw(&refined.motion.motion).map(f64::to_bits));
            *counts.entry("turns").or_default() += u32::from(refined.gyro.is_some());
            let verdict = refined.gyro.map(|it| it.verdict);
            *counts.entry("doubted").or_default() += u32::from(verdict == Some(Verdict::Doubted));
            *counts.entry("refused").or_default() += u32::from(verdict == Some(Verdict::Refused));
            *counts.entry("distances").or_default() += u32::from(refined.wheels.is_some());
            *counts.entry("slips").or_default() +=
                u32::from(refined.wheels.is_some_and(|it| it.slip));
            *counts.entry("doubtful").or_default() +=
                u32::from(refined.outcome != Outcome::Refined);
        }
        let named = counts.iter().map(|(what, count)| format!("{what} {count}"));
        Ran {
            motions,
            named: named.chain(samples.faults().iter().cloned()).collect(),
        }
    }
}

/// A row of a log.
#[derive(Clone, Debug, PartialEq)]
struct Row {
    stamp_ns: i64,
    values: Vec<f64>,
}

impl Row {
    fn of(sample: &Sample) -> Self {
        let count = if sample.is(SampleKind::Gyro) { 3 } else { 1 };
        Self {
            stamp_ns: sample.stamp_ns,
            values: sample.values[..count].to_vec(),
        }
    }

    fn line(&self) -> String {
        let values = self.values.iter().map(|value| format!(",{value}"));
        format!("{}{}\n", self.stamp_ns, values.collect::<String>())
    }

    fn last(&mut self) -> &mut f64 {
        self.values.last_mut().unwrap()
    }
}

/// SplitMix64 (Steele et al. 2014).
struct Numbers(u64);

impl Numbers {
    fn next(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut bits = self.0;
        bits = (bits ^ (bits >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        bits = (bits ^ (bits >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        bits ^ (bits >> 31)
    }

    fn below(&mut self, end: usize) -> usize {
        (self.next() % end as u64) as usize
    }
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

/// Samples of a sweep.
const SWEEP: [usize; 2] = [26, 13];

/// The duration of faults.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Length {
    /// For a sweep or more.
    Long,
    /// For less than a sweep.
    Short,
}

impl Length {
    /// Draws a number of samples of a gyro (0) or of wheels (1).
    fn draw(self, sensor: usize, seed: u64, numbers: &mut Numbers) -> usize {
        let sweep = SWEEP[sensor];
        match (self, seed / 14 % 3) {
            (Self::Long, _) => sweep + numbers.below(94 / (1 + sensor)),
            (Self::Short, 0) => 1,
            (Self::Short, 1) => 1 + numbers.below(5),
            (Self::Short, _) => 1 + numbers.below(sweep - 1),
        }
    }
}

/// Puts a fault of a kind into so many rows of a log, which is of a gyro or of wheels.
fn spoil(rows: &mut Vec<Row>, kind: &str, is_gyro: bool, count: usize, numbers: &mut Numbers) {
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
            .for_each(|row| *row.last() = f64::NAN),
        "jump" => {
            let (least, wide) = if is_gyro { (0.5, 80) } else { (3.0, 500) };
            let by = least + 0.1 * numbers.below(wide) as f64;
            let by = if numbers.below(2) == 0 { by } else { -by };
            rows[stretch].iter_mut().for_each(|row| *row.last() += by);
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
fn faults(count: u64, scans: usize, length: Length) {
    let drive = Drive::new(scans);
    let rows = |samples: &[Sample]| samples.iter().map(Row::of).collect::<Vec<_>>();
    let logs = [rows(&drive.gyro), rows(&drive.wheels)];
    let good = drive.run(&logs[0], &logs[1]);
    assert_eq!(good.motions.len(), scans - 1, "{good:?}");
    let mut silent = Vec::new();
    let mut of_kind: BTreeMap<String, [u32; 3]> = BTreeMap::new();
    for seed in 0..count {
        let mut numbers = Numbers(seed);
        let kind = KINDS[(seed as usize) % KINDS.len()];
        let is_gyro = (seed as usize / KINDS.len()).is_multiple_of(2);
        let mut spoilt = logs.clone();
        let sensor = usize::from(!is_gyro);
        let samples = length.draw(sensor, seed, &mut numbers);
        spoil(&mut spoilt[sensor], kind, is_gyro, samples, &mut numbers);
        let ran = drive.run(&spoilt[0], &spoilt[1]);
        let verdict = match (ran.motions == good.motions, ran.named == good.named) {
            (true, _) => 0,
            (false, false) => 1,
            (false, true) => 2,
        };
        let sensor = if is_gyro { "gyro" } else { "wheels" };
        of_kind.entry(format!("{sensor}, {kind}")).or_default()[verdict] += 1;
        if verdict == 2 {
            silent.push(format!("seed {seed}: {sensor}, {kind}, {samples} samples"));
        }
    }
    println!("{length:?}, unchanged, named, silent: {of_kind:#?}");
    assert!(silent.is_empty(), "change motions silently: {silent:#?}");
}

#[test]
fn no_fault_of_samples_changes_a_motion_silently() {
    faults(28, 16, Length::Long);
    faults(42, 16, Length::Short);
}
