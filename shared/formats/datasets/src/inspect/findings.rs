//! Faults of a dataset, in sentences.

use std::path::Path;

use super::{
    Chirps, GnssReport, GroundTruthReport, GyroReport, LogTimes, Report, TimingReport, WheelReport,
};
use crate::dataset::{DatasetOptions, Format};
use gyre_radar::MAX_OFFSET_S;
use gyre_samples::SampleKind;

/// Maximum number of scans that are listed; more are counted.
const MAX_LISTED: usize = 8;
/// A shorter path is that of a trajectory that stands, m.
const STANDING_M: f64 = 0.1;

pub(super) fn list(report: &Report, notes: &[String], options: &DatasetOptions) -> Vec<String> {
    let mut found = notes.to_vec();
    found.extend(resolution(report, options));
    match &report.timing {
        Some(timing) => found.extend(times(timing)),
        None => found.push(
            "The files are not named by times: scans have only the times of their rows.".to_owned(),
        ),
    }
    found.extend(rows(report));
    found.extend(scans(report));
    match report.ground_truths.as_slice() {
        [] => found.push(
            "No ground truth was found: odometry can run, but cannot be evaluated.".to_owned(),
        ),
        ground_truths => found.extend(
            ground_truths
                .iter()
                .flat_map(|truth| ground_truth_findings(truth, report)),
        ),
    }
    found.extend(report.gyro.iter().flat_map(gyro));
    found.extend(report.wheels.iter().flat_map(wheels));
    found.extend(report.gnss.iter().flat_map(gnss));
    found
}

fn gyro(report: &GyroReport) -> Vec<String> {
    if let Some(error) = &report.error {
        return vec![unusable("a gyro", &report.file, error)];
    }
    let faults = report.faults.sentences(SampleKind::Gyro).into_iter();
    let mut found: Vec<String> = faults.map(|it| format!("Gyro: {it}")).collect();
    found.extend(
        report
            .up_by_gravity
            .map(|up| format!("Gyro: by gravity its axis {} points up.", up.name())),
    );
    let name = report.file.file_name().unwrap_or_default().display();
    let clocks = of_clocks(&report.times);
    found.push(format!(
        "The log of a gyro, {name}{clocks}, lies beside the scans: `gyre calibrate` finds its axis and how late its clock is, and gyro.kind = \"auto\" uses it."
    ));
    found
}

fn wheels(report: &WheelReport) -> Vec<String> {
    if let Some(error) = &report.error {
        return vec![unusable("the wheels", &report.file, error)];
    }
    let faults = report.faults.sentences(SampleKind::Wheels).into_iter();
    let mut found: Vec<String> = faults.map(|it| format!("Wheels: {it}")).collect();
    let name = report.file.file_name().unwrap_or_default().display();
    let clocks = of_clocks(&report.times);
    found.push(format!(
        "The log of the wheels, {name}{clocks}, lies beside the scans: `gyre calibrate` finds how late its clock is, and wheels.kind = \"auto\" uses it."
    ));
    found
}

fn gnss(report: &GnssReport) -> Vec<String> {
    if let Some(error) = &report.error {
        return vec![unusable("a GNSS receiver", &report.file, error)];
    }
    let faults = report.faults.named().into_iter();
    let faults: Vec<String> = faults
        .map(|(count, what)| format!("{count} {what}"))
        .collect();
    let faults = (!faults.is_empty()).then(|| {
        format!(
            "GNSS: entries of its log that are left out, or sorted: {}.",
            faults.join(", ")
        )
    });
    let name = report.file.file_name().unwrap_or_default().display();
    let clocks = of_clocks(&report.times);
    let place = match report.on_the_earth {
        true => "",
        false => " Its plane is its own: the map has no place on the earth by it.",
    };
    let lies = match &report.topic {
        Some(topic) => format!("{topic}{clocks}, is in the bag"),
        None => format!("{name}{clocks}, lies beside the scans"),
    };
    let found = format!(
        "The log of a GNSS receiver, {lies}: with slam.kind = \"graph\", gnss.kind = \"auto\" uses it.{place}"
    );
    faults.into_iter().chain([found]).collect()
}

fn unusable(of: &str, file: &Path, error: &str) -> String {
    let name = file.file_name().unwrap_or_default().display();
    format!("The log of {of}, {name}, cannot be used: {error}.")
}

/// Says it where the stamps of a log do not cover those of the scans.
fn of_clocks(times: &LogTimes) -> &'static str {
    match times.cover_scans() {
        true => "",
        false => ", whose stamps do not cover those of the scans",
    }
}

fn resolution(report: &Report, options: &DatasetOptions) -> Option<String> {
    let oxford = matches!(report.format, Format::Oxford | Format::Oord)
        && options.range_resolution_m.is_none();
    oxford.then(|| {
        format!(
            "The range resolution is {} m: with the 0.0432 m of the development kit, paths are more than 1 % short.",
            report.range_resolution_m
        )
    })
}

fn times(timing: &TimingReport) -> impl Iterator<Item = String> {
    let worst = timing.stalls.iter().map(|s| s.late_s).fold(0.0, f64::max);
    let stalls = (!timing.stalls.is_empty()).then(|| {
        let places = some(timing.stalls.iter().map(|s| format!("{} ({:.2} s)", s.scan, s.late_s)));
        format!(
            "The host stalled {}, by up to {worst:.2} s, and caught up while the antenna turned uniformly: logged stamps are late from scans {places}.",
            times_text(timing.stalls.len())
        )
    });
    let gaps = (!timing.gaps.is_empty()).then(|| {
        let places = some(
            timing
                .gaps
                .iter()
                .map(|g| format!("{} ({} missing)", g.scan, g.missing)),
        );
        let missing = if timing.missing_scans == 1 {
            "1 scan is".to_owned()
        } else {
            format!("{} scans are", timing.missing_scans)
        };
        format!("{missing} missing, before scans {places}.")
    });
    let backwards = (!timing.backwards.is_empty()).then(|| {
        format!(
            "Logged time runs backwards at scans {}.",
            some(timing.backwards.iter().map(ToString::to_string))
        )
    });
    [stalls, gaps, backwards].into_iter().flatten()
}

fn times_text(n: usize) -> String {
    if n == 1 {
        "once".to_owned()
    } else {
        format!("{n} times")
    }
}

fn rows(report: &Report) -> impl Iterator<Item = String> {
    let rows = &report.rows;
    let percent = |n: u64| 100.0 * n as f64 / rows.rows.max(1) as f64;
    let interpolated = (rows.not_measured > 0).then(|| {
        format!(
            "{} of {} rows ({:.2} %) were not measured but interpolated from their neighbours.",
            rows.not_measured,
            rows.rows,
            percent(rows.not_measured)
        )
    });
    let stale = (rows.stale > 0).then(|| {
        format!(
            "{} of {} scans have lost azimuths, {} in all: the rows behind each have moved up by one, and the last rows are still those of the scan before. Odometry finds where they were lost (dataset.lost_azimuths).",
            rows.stale_scans, report.scans_read, rows.stale
        )
    });
    let (fewest, most) = rows.in_scan;
    let fewer = (fewest < most).then(|| {
        format!("Scans have {fewest} to {most} rows: some have lost azimuths, and are read with those that there are.")
    });
    let lost = (rows.lost > 0).then(|| format!("{} rows are lost: the azimuth jumps.", rows.lost));
    let chirps = (rows.chirps == Chirps::Mixed)
        .then(|| "The directions of the chirps are known in some scans only.".to_owned());
    let ringing = (rows.ringing_bins > 0).then(|| {
        format!(
            "Range bins 0 to {} (to {:.1} m) are ringing of the sensor: uniform over azimuth, and stronger than the scene; set the minimum range above that.",
            rows.ringing_bins - 1,
            rows.ringing_bins as f32 * report.range_resolution_m + report.range_offset_m
        )
    });
    [interpolated, stale, fewer, lost, chirps, ringing]
        .into_iter()
        .flatten()
}

fn scans(report: &Report) -> impl Iterator<Item = String> {
    let single = (report.scans == 1)
        .then(|| "There is only one scan, but a motion requires two.".to_owned());
    let unreadable = (!report.unreadable.is_empty()).then(|| {
        let first = report
            .unreadable
            .first()
            .map(|u| u.error.clone())
            .unwrap_or_default();
        let places = some(report.unreadable.iter().map(|u| u.scan.to_string()));
        format!(
            "{} of {} scans cannot be read (scans {places}): {first}.",
            report.unreadable.len(),
            report.scans_read
        )
    });
    [single, unreadable].into_iter().flatten()
}

fn ground_truth_findings(truth: &GroundTruthReport, report: &Report) -> Vec<String> {
    let name = truth
        .file
        .file_name()
        .map(|n| n.to_string_lossy().into_owned())
        .unwrap_or_default();
    if let Some(error) = &truth.error {
        return vec![format!("The ground truth cannot be read: {error}.")];
    }
    let heading = (!truth.has_heading && truth.poses > 1)
        .then(|| format!("{name} has positions only, no headings."));
    let stands = (truth.poses > 1 && truth.path_length_m < STANDING_M)
        .then(|| format!("{name} stands still: all its poses are in one place."));
    let unstamped = truth
        .span_ns
        .is_none()
        .then(|| format!("{name} has no times: poses can be compared by index only."));
    let covered = truth
        .scans_covered
        .filter(|n| *n < report.scans)
        .map(|n| format!("{name} covers {n} of {} scans.", report.scans));
    [
        heading,
        stands,
        unstamped,
        covered,
        clock_finding(truth, &name),
    ]
    .into_iter()
    .flatten()
    .collect()
}

fn clock_finding(truth: &GroundTruthReport, name: &str) -> Option<String> {
    let clock = truth.clock.as_ref()?;
    if !clock.is_reliable() {
        return Some(format!(
            "{name} does not correlate with the given trajectory at any offset within {MAX_OFFSET_S} s: its clock cannot be compared."
        ));
    }
    let mirrored = if clock.mirrored {
        " and mirrored (it turns left where the trajectory turns right)"
    } else {
        ""
    };
    match clock.agrees() {
        true if clock.mirrored => Some(format!("The clock of {name} agrees{mirrored}.")),
        true => None,
        false => Some(format!(
            "{name} is {clock} relative to the given trajectory{mirrored}."
        )),
    }
}

/// Lists the first items, and counts the rest.
fn some(items: impl ExactSizeIterator<Item = String>) -> String {
    let more = items.len().saturating_sub(MAX_LISTED);
    let named = items.take(MAX_LISTED).collect::<Vec<_>>().join(", ");
    if more == 0 {
        named
    } else {
        format!("{named} and {more} more")
    }
}
