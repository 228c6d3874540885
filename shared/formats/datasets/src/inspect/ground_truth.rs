//! The ground truth files of a dataset: their coverage and clocks.

use std::path::{Path, PathBuf};

use serde::Serialize;

use crate::dataset::Dataset;
use crate::ground_truth::{find_ground_truth, read_trajectory};
use gyre_radar::median;
use gyre_radar::trajectory::Trajectory;
use gyre_radar::{ClockOffset, clock_offset};

/// Tolerance of the time span, ns: without decoding, times of scans are known to a few
/// milliseconds.
const MARGIN_NS: i64 = 20_000_000;

/// Summary of a ground truth file.
#[derive(Clone, Debug, Serialize)]
pub struct GroundTruthReport {
    /// The file.
    pub file: PathBuf,
    /// Why it cannot be read; the fields below are empty then.
    pub error: Option<String>,
    /// Number of poses.
    pub poses: usize,
    /// Length of the path, m.
    pub path_length_m: f64,
    /// True if it has headings.
    pub has_heading: bool,
    /// First and last time, ns; `None` if it has no times.
    pub span_ns: Option<(i64, i64)>,
    /// Number of scans within its time span; `None` if times are unknown.
    pub scans_covered: Option<usize>,
    /// Median difference between the time of a scan and the nearest pose, s.
    pub nearest_pose_s: Option<f64>,
    /// The clock relative to the given trajectory.
    pub clock: Option<ClockOffset>,
}

/// Examines the ground truth at the usual path and all TUM files in the root, by name.
pub(super) fn examine(
    root: &Path,
    dataset: &dyn Dataset,
    trajectory: Option<&Trajectory>,
) -> Vec<GroundTruthReport> {
    let mut files: Vec<PathBuf> = std::fs::read_dir(root)
        .into_iter()
        .flatten()
        .flatten()
        .map(|entry| entry.path())
        .collect();
    let is_hidden = |path: &Path| {
        let name = path.file_name().unwrap_or_default();
        name.as_encoded_bytes().starts_with(b".")
    };
    let is_tum = |path: &Path| path.extension().is_some_and(|e| e == "tum") && path.is_file();
    files.retain(|path| is_tum(path) && !is_hidden(path));
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

fn examine_file(
    file: PathBuf,
    scans_ns: &[i64],
    trajectory: Option<&Trajectory>,
) -> GroundTruthReport {
    let (truth, error) = match read_trajectory(&file) {
        Ok(truth) => (truth, None),
        Err(error) => (Trajectory::default(), Some(error.to_string())),
    };
    let within = |(first, last): (i64, i64)| {
        let span = first.saturating_sub(MARGIN_NS)..=last.saturating_add(MARGIN_NS);
        scans_ns.iter().filter(|s| span.contains(s)).count()
    };
    GroundTruthReport {
        file,
        error,
        poses: truth.len(),
        path_length_m: truth.path_length_m(),
        has_heading: truth.has_heading(),
        span_ns: truth.span_ns(),
        scans_covered: truth.span_ns().map(within).filter(|_| !scans_ns.is_empty()),
        nearest_pose_s: nearest_pose_s(&truth, scans_ns),
        clock: trajectory.and_then(|given| clock_offset(given, &truth)),
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
