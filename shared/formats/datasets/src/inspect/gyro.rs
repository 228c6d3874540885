//! The log of a gyro beside the scans: its rate, its span and its faults.

use std::path::{Path, PathBuf};

use gyre_samples::{Sample, UpAxis};
use serde::Serialize;

use super::{LogTimes, TimingReport};
use crate::gyro_log::{GyroLog, LogError, LogFaults};

/// Time in which the gyro is looked at where it turns least, s.
const QUIET_S: f64 = 5.0;
/// Share of the samples that such a time has at least.
const QUIET_SHARE: f64 = 0.9;

/// Summary of the log of a gyro.
#[derive(Clone, Debug, Serialize)]
pub struct GyroReport {
    /// The log.
    pub file: PathBuf,
    /// Why it cannot be used; the fields below are empty then.
    pub error: Option<String>,
    /// The stamps.
    #[serde(flatten)]
    pub times: LogTimes,
    /// The time in which the rates vary least: the bias and the noise, if the vehicle stood.
    pub quiet: Option<QuietReport>,
    /// The axis that points up, if the accelerations have gravity.
    pub up_by_gravity: Option<UpAxis>,
    /// Faults of the samples.
    pub faults: LogFaults,
}

/// The rates of a quiet time.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct QuietReport {
    /// The start, s since the first sample.
    pub after_s: f64,
    /// Mean rates about x, y, z, deg/s.
    pub mean_degps: [f64; 3],
    /// Their standard deviations, deg/s.
    pub sigma_degps: [f64; 3],
}

/// Examines the log beside the scans; `None` if there is none.
pub(super) fn examine(root: &Path, timing: Option<&TimingReport>) -> Option<GyroReport> {
    match GyroLog::find(root) {
        Ok(file) => Some(examine_file(&file, timing)),
        Err(LogError::InTruth { path }) => Some(GyroReport::of(
            &path,
            Some(
                "the ground truth was computed of it: name it in gyro.file to use it all the same"
                    .to_owned(),
            ),
        )),
        Err(_) => None,
    }
}

fn examine_file(file: &Path, timing: Option<&TimingReport>) -> GyroReport {
    let log = match GyroLog::read(file) {
        Ok(log) => log,
        Err(error) => return GyroReport::of(file, Some(error.to_string())),
    };
    let samples = &log.samples[..];
    let stamps: Vec<i64> = samples.iter().map(|sample| sample.stamp_ns).collect();
    let times = LogTimes::of(&stamps, timing);
    let period_s = if times.rate_hz > 0.0 {
        1.0 / times.rate_hz
    } else {
        0.0
    };
    GyroReport {
        times,
        quiet: quiet(samples, period_s),
        up_by_gravity: log.up_by_gravity(),
        faults: log.faults.clone(),
        ..GyroReport::of(file, None)
    }
}

impl GyroReport {
    fn of(file: &Path, error: Option<String>) -> Self {
        Self {
            file: file.to_owned(),
            error,
            times: LogTimes::default(),
            quiet: None,
            up_by_gravity: None,
            faults: LogFaults::default(),
        }
    }
}

fn apart_s(from: &Sample, to: &Sample) -> f64 {
    (to.stamp_ns - from.stamp_ns) as f64 * 1e-9
}

/// The time of [`QUIET_S`] in which the rates vary least.
fn quiet(samples: &[Sample], period_s: f64) -> Option<QuietReport> {
    let least = (QUIET_SHARE * QUIET_S / period_s.max(1e-9)) as usize;
    let windows = (0..samples.len()).step_by((least / 5).max(1)).map(|from| {
        let rest = &samples[from..];
        let count = rest.partition_point(|it| apart_s(&samples[from], it) < QUIET_S);
        &rest[..count]
    });
    let full = windows.filter(|window| window.len() >= least.max(2));
    let quietest = full.min_by(|a, b| variance(a).total_cmp(&variance(b)))?;
    let (mean, squares) = moments(quietest);
    Some(QuietReport {
        after_s: apart_s(samples.first()?, quietest.first()?),
        mean_degps: mean.map(f64::to_degrees),
        sigma_degps: squares.map(|square| square.sqrt().to_degrees()),
    })
}

fn variance(samples: &[Sample]) -> f64 {
    moments(samples).1.iter().sum()
}

/// The means and the variances of the rates.
fn moments(samples: &[Sample]) -> ([f64; 3], [f64; 3]) {
    let count = samples.len() as f64;
    let mean = [0, 1, 2].map(|k| samples.iter().map(|it| it.values[k]).sum::<f64>() / count);
    let variance = [0, 1, 2].map(|k| {
        let squares = samples.iter().map(|it| (it.values[k] - mean[k]).powi(2));
        squares.sum::<f64>() / count
    });
    (mean, variance)
}
