//! Ground truth beside a dataset: what it covers, and whether its clock agrees.

use std::path::{Path, PathBuf};

use serde::Serialize;

use super::clock::{self, ClockOffset};
use crate::dataset::Dataset;
use crate::ground_truth::{find_ground_truth, read_trajectory};
use crate::median::median;
use crate::trajectory::Trajectory;

/// Without decoding, the last scan's time is known to a few milliseconds; that is no reason to count it as outside, ns.
const MARGIN_NS: i64 = 20_000_000;

/// A ground truth file.
#[derive(Clone, Debug, Serialize)]
pub struct TruthReport {
    /// The file.
    pub file: PathBuf,
    /// Why it could not be read; all below is empty then.
    pub error: Option<String>,
    /// Poses.
    pub poses: usize,
    /// Path, m.
    pub path_length_m: f64,
    /// Whether it has headings.
    pub has_heading: bool,
    /// First and last time, ns; `None` where it has no times.
    pub span_ns: Option<(i64, i64)>,
    /// Scans whose time is within its span; `None` where times are not known.
    pub scans_covered: Option<usize>,
    /// Median distance from a scan's time to the nearest pose's, s.
    pub nearest_pose_s: Option<f64>,
    /// Its clock against the trajectory that was given.
    pub clock: Option<ClockOffset>,
}

/// The usual place's file and all TUM files in the root, by name.
pub(super) fn examine(
    root: &Path,
    dataset: &dyn Dataset,
    trajectory: Option<&Trajectory>,
) -> Vec<TruthReport> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(root)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path())
        .collect();
    files.retain(|path| path.extension().is_some_and(|e| e == "tum") && path.is_file());
    files.extend(find_ground_truth(root));
    files.sort();
    files.dedup();
    let stamps: Vec<i64> = (0..dataset.len())
        .filter_map(|i| dataset.nominal_stamp_ns(i))
        .collect();
    files
        .into_iter()
        .map(|file| examine_file(file, &stamps, trajectory))
        .collect()
}

fn examine_file(file: PathBuf, scans_ns: &[i64], trajectory: Option<&Trajectory>) -> TruthReport {
    let (truth, error) = match read_trajectory(&file) {
        Ok(truth) => (truth, None),
        Err(error) => (Trajectory::default(), Some(error.to_string())),
    };
    let within = |(first, last): (i64, i64)| {
        let span = first.saturating_sub(MARGIN_NS)..=last.saturating_add(MARGIN_NS);
        scans_ns.iter().filter(|s| span.contains(s)).count()
    };
    TruthReport {
        file,
        error,
        poses: truth.len(),
        path_length_m: truth.path_length_m(),
        has_heading: truth.has_heading(),
        span_ns: truth.span_ns(),
        scans_covered: truth.span_ns().map(within).filter(|_| !scans_ns.is_empty()),
        nearest_pose_s: nearest_pose_s(&truth, scans_ns),
        clock: trajectory.and_then(|given| clock::offset(given, &truth)),
    }
}

fn nearest_pose_s(truth: &Trajectory, scans_ns: &[i64]) -> Option<f64> {
    let stamps = truth.stamp_ns.as_ref()?;
    let nearest = |scan: &i64| {
        let after = stamps.partition_point(|s| s < scan);
        let around = [after.checked_sub(1), Some(after)].into_iter().flatten();
        around
            .filter_map(|i| stamps.get(i))
            .map(|s| (s - scan).abs())
            .min()
    };
    median(
        scans_ns
            .iter()
            .filter_map(nearest)
            .map(|ns| ns as f64 * 1e-9),
    )
}
