//! The ground truth files of a dataset, and the scans that they cover.

use std::path::{Path, PathBuf};

use gyre_radar::{median, trajectory::Trajectory};
use serde_json::{Value, json};

use super::Report;
use crate::{
    dataset::Dataset,
    ground_truth::{find_ground_truth, read_trajectory},
};

/// Tolerance of the time span, ns: without decoding, times of scans are known to a few
/// milliseconds.
const MARGIN_NS: i64 = 20_000_000;

/// A trajectory with a shorter path stands, m.
const STANDING_M: f64 = 0.1;

pub(super) fn examine(report: &mut Report, dataset: &dyn Dataset) {
    let entries = std::fs::read_dir(&report.root).into_iter().flatten();
    let mut files: Vec<PathBuf> = entries.flatten().map(|entry| entry.path()).collect();
    let is_shown = |path: &Path| {
        let name = path.file_name().unwrap_or_default();
        !name.as_encoded_bytes().starts_with(b".")
    };
    files.retain(|path| path.extension().is_some_and(|e| e == "tum") && path.is_file());
    files.retain(|path| is_shown(path));
    files.extend(find_ground_truth(&report.root));
    files.sort();
    files.dedup();
    if files.is_empty() {
        report.line("ground truth", "none found".to_owned());
        report.find(
            "No ground truth was found: odometry can run, but cannot be evaluated.".to_owned(),
        );
    }
    let stamps = (0..dataset.len()).filter_map(|i| dataset.nominal_stamp_ns(i));
    let stamps: Vec<i64> = stamps.collect();
    let mut figures = Vec::new();
    for file in &files {
        figures.push(examine_file(report, file, &stamps));
    }
    report.figure("ground_truths", figures);
}

fn examine_file(report: &mut Report, file: &Path, scans_ns: &[i64]) -> Value {
    let name = report.name_of(file);
    let truth = match read_trajectory(file) {
        Ok(truth) => truth,
        Err(error) => {
            let error = error.to_string();
            report.line("ground truth", format!("{name}: cannot be read"));
            report.find(format!("The ground truth cannot be read: {error}."));
            return json!({"file": file, "error": error});
        }
    };
    let within = |(first, last): (i64, i64)| {
        let span = first.saturating_sub(MARGIN_NS)..=last.saturating_add(MARGIN_NS);
        scans_ns.iter().filter(|s| span.contains(s)).count()
    };
    let (span_ns, poses, path_m) = (truth.span_ns(), truth.len(), truth.path_length_m());
    let covered = span_ns.map(within).filter(|_| !scans_ns.is_empty());
    let nearest_s = nearest_pose_s(&truth, scans_ns);
    let span = span_ns.map_or("no times".to_owned(), |(a, b)| {
        format!("{:.1} s", (b - a) as f64 * 1e-9)
    });
    let covers = covered.map_or(String::new(), |n| format!(", covers {n} scans"));
    let nearest = nearest_s.map_or(String::new(), |s| {
        format!(", median distance of the nearest pose {:.1} ms", s * 1e3)
    });
    report.line(
        "ground truth",
        format!("{name}: {poses} poses, {path_m:.1} m, {span}{covers}{nearest}"),
    );
    let found = findings(file, &truth, covered, report.scans);
    report.findings.extend(found);
    json!({
        "file": file,
        "error": null,
        "poses": poses,
        "path_length_m": path_m,
        "has_heading": truth.has_heading(),
        "span_ns": span_ns,
        "scans_covered": covered,
        "nearest_pose_s": nearest_s,
    })
}

fn findings(
    file: &Path,
    truth: &Trajectory,
    covered: Option<usize>,
    scans: usize,
) -> impl Iterator<Item = String> {
    let name = file.file_name().unwrap_or_default().to_string_lossy();
    let lacks = |is_so: bool, what: &str| is_so.then(|| format!("{name} {what}."));
    let (is_path, path_m) = (truth.len() > 1, truth.path_length_m());
    let no_headings = "has positions only, no headings";
    let stands = "stands still: all its poses are in one place";
    let no_times = "has no times: poses can be compared by index only";
    let partly = covered.filter(|n| *n < scans);
    let findings = [
        lacks(is_path && !truth.has_heading(), no_headings),
        lacks(is_path && path_m < STANDING_M, stands),
        lacks(truth.span_ns().is_none(), no_times),
        partly.map(|n| format!("{name} covers {n} of {scans} scans.")),
    ];
    findings.into_iter().flatten()
}

fn nearest_pose_s(truth: &Trajectory, scans_ns: &[i64]) -> Option<f64> {
    let stamps = truth.stamp_ns.as_ref()?;
    let nearest = |scan: &i64| {
        let after = stamps.partition_point(|s| s < scan);
        let around = stamps.get(after.saturating_sub(1)..).unwrap_or_default();
        let around = around.iter().take(2);
        around.map(|s| (s - scan).abs()).min()
    };
    let nearest = scans_ns.iter().filter_map(nearest);
    median(nearest.map(|ns| ns as f64 * 1e-9))
}
