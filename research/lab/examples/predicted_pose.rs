//! Judges the poses between scans: predicts from each pose of a run by the samples of its recording,
//! and compares with the ground truth.
//!
//! `cargo run --release --example predicted_pose -- RUN TRUTH.tum [gyro=LOG] [wheels=LOG]
//! [gyro.KEY=VALUE]`

use std::{env, error::Error, path::Path};

use gyre_contract::PoseHeader;
use gyre_datasets::{SampleLog, read_trajectory};
use gyre_geometry::{
    Pose, UncertainMotion, interpolate,
    samples::{Sample, SampleKind, SensorConfig, SensorConfigs},
};
use nalgebra::Vector3;

const AHEAD_MS: [i64; 4] = [60, 125, 250, 375];

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = env::args().skip(1).collect();
    let [run, truth, ..] = &words[..] else {
        return Err("name a run and its ground truth".into());
    };
    let mut configs = SensorConfigs::default();
    let mut samples: Vec<Sample> = Vec::new();
    for word in &words[2..] {
        let (key, value) = word.split_once('=').ok_or("not key=value")?;
        match key {
            "delay" => configs.gyro.delay_s = value.parse()?,
            "scale" => configs.gyro.scale = value.parse()?,
            "up" => configs.gyro.up = Some(toml::Value::from(value).try_into()?),
            "gyro" => {
                samples.extend(log(&configs.gyro, SampleKind::Gyro, value)?);
            }
            "wheels" => {
                samples.extend(log(&configs.wheels, SampleKind::Wheels, value)?);
            }
            _ => return Err(format!("unknown {key}").into()),
        }
    }
    samples.sort_unstable_by_key(Sample::order);
    let truth = read_trajectory(Path::new(truth))?;
    let stamps = truth.stamp_ns.ok_or("the truth has no times")?;
    let true_at = |ns: i64| -> Option<Pose> {
        let next = stamps.partition_point(|it| *it <= ns);
        let (a, b) = (*stamps.get(next.checked_sub(1)?)?, *stamps.get(next)?);
        let share = (ns - a) as f64 / (b - a) as f64;
        (b - a < 600_000_000)
            .then(|| interpolate(&truth.poses[next - 1], &truth.poses[next], share))
    };
    let poses: Vec<PoseHeader> = gyre_journal::poses(Path::new(run))?.collect::<Result<_, _>>()?;
    println!("ahead ms   n   along m  across m  yaw deg   NEES x, y, yaw");
    for ahead_ms in AHEAD_MS {
        let mut errors: Vec<[f64; 6]> = Vec::new();
        for pose in &poses {
            let mut start = pose.prediction_start();
            // The error of the pose itself is not judged here.
            start.pose = UncertainMotion::identity();
            let at_ns = start.stamp_ns + ahead_ms * 1_000_000;
            let first = samples.partition_point(|it| it.stamp_ns < start.stamp_ns - 300_000_000);
            let predicted = start.predict(&configs, &samples[first..], at_ns);
            let ends = true_at(start.stamp_ns).zip(true_at(at_ns));
            let Some((predicted, (from, to))) = predicted.zip(ends) else {
                continue;
            };
            let error: Vector3<f64> = predicted.error(&from.inv_mul(&to));
            let nees = |k| error[k] * error[k] / predicted.covariance[(k, k)];
            errors.push([error.x, error.y, error.z, nees(0), nees(1), nees(2)]);
        }
        let mean = |of: &dyn Fn(&[f64; 6]) -> f64| {
            errors.iter().map(of).sum::<f64>() / errors.len() as f64
        };
        let rms = |k: usize| mean(&|it: &[f64; 6]| it[k] * it[k]).sqrt();
        let of = |k: usize| mean(&|it: &[f64; 6]| it[k]);
        println!(
            "{ahead_ms:8} {:4} {:8.3} {:8.3} {:8.3}    {:.2} {:.2} {:.2}",
            errors.len(),
            rms(0),
            rms(1),
            rms(2).to_degrees(),
            of(3),
            of(4),
            of(5)
        );
    }
    Ok(())
}

fn log(
    config: &dyn SensorConfig,
    of: SampleKind,
    file: &str,
) -> Result<Vec<Sample>, Box<dyn Error>> {
    let log = SampleLog::read(of, Path::new(file), None)?;
    let samples = log.samples.iter().map(|it| config.on_radar(it, None));
    Ok(samples.filter(Sample::is_valid).collect())
}
