//! The log of a gyro beside the scans: its rate, its span and its faults.

use std::path::{Path, PathBuf};

use gyre_samples::{Sample, UpAxis};
use serde::Serialize;

use super::TimingReport;
use crate::gyro_log::{GyroLog, LogError, LogFaults};
use gyre_radar::median;

/// Time in which the gyro is looked at where it turns least, s.
const QUIET_S: f64 = 5.0;
/// Share of the samples that such a time has at least.
const QUIET_SHARE: f64 = 0.9;
/// Accelerations that can be gravity's, m/s², and its share along the axis that points up.
const GRAVITY_MPS2: std::ops::RangeInclusive<f64> = 9.3..=10.3;
const UPRIGHT: f64 = 0.9;

/// Summary of the log of a gyro.
#[derive(Clone, Debug, Serialize)]
pub struct GyroReport {
    /// The log.
    pub file: PathBuf,
    /// Why it cannot be used; the fields below are empty then.
    pub error: Option<String>,
    /// Number of samples that can be used.
    pub samples: usize,
    /// Median rate, Hz.
    pub rate_hz: f64,
    /// RMS deviation of the time between samples from its median, s, without gaps.
    pub jitter_s: f64,
    /// First and last stamp, ns, on the log's own clock.
    pub span_ns: Option<[i64; 2]>,
    /// Samples that are missing between them, share of all.
    pub missing: f64,
    /// First and last stamp against those of the scans, s.
    pub after_scans_s: Option<[f64; 2]>,
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
    let steps_s: Vec<f64> = samples
        .windows(2)
        .map(|pair| apart_s(&pair[0], &pair[1]))
        .collect();
    let period_s = median(steps_s.iter().copied()).unwrap_or_default();
    let regular = steps_s.iter().map(|step_s| step_s - period_s);
    let regular: Vec<f64> = regular.filter(|apart_s| *apart_s < period_s).collect();
    let squares: f64 = regular.iter().map(|apart_s| apart_s * apart_s).sum();
    let span = samples.first().zip(samples.last());
    let slots = span.map_or(0.0, |(first, last)| {
        apart_s(first, last) / period_s.max(1e-9) + 1.0
    });
    GyroReport {
        samples: samples.len(),
        rate_hz: if period_s > 0.0 { 1.0 / period_s } else { 0.0 },
        jitter_s: (squares / regular.len().max(1) as f64).sqrt(),
        span_ns: span.map(|(first, last)| [first.stamp_ns, last.stamp_ns]),
        missing: (1.0 - samples.len() as f64 / slots.max(1.0)).max(0.0),
        after_scans_s: span.zip(timing).map(|((first, last), timing)| {
            let after = |stamp_ns: i64, scan_ns: i64| {
                (i128::from(stamp_ns) - i128::from(scan_ns)) as f64 * 1e-9
            };
            [
                after(first.stamp_ns, timing.first_ns),
                after(last.stamp_ns, timing.last_ns),
            ]
        }),
        quiet: quiet(samples, period_s),
        up_by_gravity: up_by_gravity(samples),
        faults: log.faults.clone(),
        ..GyroReport::of(file, None)
    }
}

impl GyroReport {
    fn of(file: &Path, error: Option<String>) -> Self {
        Self {
            file: file.to_owned(),
            error,
            samples: 0,
            rate_hz: 0.0,
            jitter_s: 0.0,
            span_ns: None,
            missing: 0.0,
            after_scans_s: None,
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

/// The axis along which the accelerations have gravity: what rests is accelerated upwards.
fn up_by_gravity(samples: &[Sample]) -> Option<UpAxis> {
    let count = samples.len().max(1) as f64;
    let mean = [3, 4, 5].map(|k| samples.iter().map(|it| it.values[k]).sum::<f64>() / count);
    let norm = mean.iter().map(|value| value * value).sum::<f64>().sqrt();
    let axes = [
        UpAxis::X,
        UpAxis::MinusX,
        UpAxis::Y,
        UpAxis::MinusY,
        UpAxis::Z,
        UpAxis::MinusZ,
    ];
    let is_up = |up: &UpAxis| up.in_vehicle(mean)[2] > UPRIGHT * norm;
    axes.into_iter()
        .find(is_up)
        .filter(|_| GRAVITY_MPS2.contains(&norm))
}
