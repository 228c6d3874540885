//! The log of a GNSS receiver in the bag, or beside the scans.

use std::path::{Path, PathBuf};

use gyre_radar::median;
use serde::Serialize;

use super::{LogTimes, TimingReport};
use crate::{Dataset, GnssFaults, GnssLog, GnssLogError};

/// Summary of the log of a GNSS receiver.
#[derive(Clone, Debug, Default, Serialize)]
pub struct GnssReport {
    /// The log, or the bag.
    pub file: PathBuf,
    /// The topic in the bag.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub topic: Option<String>,
    /// Why it cannot be used; the fields below are empty then.
    pub error: Option<String>,
    /// The stamps.
    #[serde(flatten)]
    pub times: LogTimes,
    /// True if the fixes are places on the earth, and not in a plane of their own.
    pub on_the_earth: bool,
    /// The longest distance of a fix from the first one, m.
    pub reach_m: f64,
    /// Median of the standard deviations that the log states, m; `None` where it has none.
    pub sigma_m: Option<f64>,
    /// Faults of the fixes.
    pub faults: GnssFaults,
}

/// Examines the fixes of the bag, else the log beside the scans; `None` if there is none.
pub(super) fn examine(
    root: &Path,
    dataset: &mut dyn Dataset,
    topic: Option<&str>,
    timing: Option<&TimingReport>,
) -> Option<GnssReport> {
    let (file, log) = match dataset.fixes(topic) {
        Ok(None) => {
            let file = GnssLog::find(root).ok()?;
            let log = GnssLog::read(&file);
            (file, log)
        }
        Ok(Some(fixes)) => (root.to_owned(), GnssLog::of(fixes, root)),
        Err(error) => (root.to_owned(), Err(GnssLogError::Open(error))),
    };
    Some(match log {
        Ok(log) => GnssReport::of(file, log, timing),
        Err(error) => GnssReport {
            file,
            error: Some(error.to_string()),
            ..GnssReport::default()
        },
    })
}

impl GnssReport {
    fn of(file: PathBuf, log: GnssLog, timing: Option<&TimingReport>) -> Self {
        let stamps: Vec<i64> = log.fixes.iter().map(|fix| fix.stamp_ns).collect();
        let [east_m, north_m] = log.fixes.first().map_or([0.0; 2], |fix| fix.east_north_m);
        let from_first = log.fixes.iter().map(|fix| {
            let [east, north] = fix.east_north_m;
            (east - east_m).hypot(north - north_m)
        });
        Self {
            file,
            error: None,
            times: LogTimes::of(&stamps, timing),
            on_the_earth: log.plane.is_some(),
            reach_m: from_first.fold(0.0, f64::max),
            sigma_m: median(log.fixes.iter().filter_map(|fix| fix.sigma_m)),
            faults: log.faults,
            topic: log.topic,
        }
    }
}
