//! The log of the wheels beside the scans.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::{LogTimes, TimingReport};
use crate::{LogFaults, WheelLog};

/// Summary of the log of the wheels.
#[derive(Clone, Debug, Default, Serialize)]
pub struct WheelReport {
    /// The log.
    pub file: PathBuf,
    /// Why it cannot be used; the fields below are empty then.
    pub error: Option<String>,
    /// The stamps.
    #[serde(flatten)]
    pub times: LogTimes,
    /// The largest speed, m/s.
    pub fastest_mps: f64,
    /// The distance from the first sample to the last, m.
    pub path_m: f64,
    /// Faults of the samples.
    pub faults: LogFaults,
}

/// Examines the log beside the scans; `None` if there is none.
pub(super) fn examine(
    root: &Path,
    m_per_tick: Option<f64>,
    timing: Option<&TimingReport>,
) -> Option<WheelReport> {
    let file = WheelLog::find(root).ok()?;
    let log = match WheelLog::read(&file, m_per_tick) {
        Ok(log) => log,
        Err(error) => {
            return Some(WheelReport {
                file,
                error: Some(error.to_string()),
                ..WheelReport::default()
            });
        }
    };
    let stamps: Vec<i64> = log.samples.iter().map(|sample| sample.stamp_ns).collect();
    let speeds = log.samples.iter().map(|sample| sample.values[0]);
    let steps = log.samples.windows(2).map(|pair| {
        let seconds = (pair[1].stamp_ns - pair[0].stamp_ns) as f64 * 1e-9;
        0.5 * (pair[0].values[0] + pair[1].values[0]) * seconds
    });
    Some(WheelReport {
        file,
        error: None,
        times: LogTimes::of(&stamps, timing),
        fastest_mps: speeds.map(f64::abs).fold(0.0, f64::max),
        path_m: steps.map(f64::abs).sum(),
        faults: log.faults,
    })
}
