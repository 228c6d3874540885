//! The results of a run, as far as a row has them: `summary.json`, `trajectory.tum`, `journal/run.toml`.

use std::{collections::BTreeMap, io, path::Path};

use gyre_evaluation::path_m;
use gyre_radar::ground_truth::read_trajectory;
use serde::Deserialize;

use super::{Figures, Times};
use crate::BatchError;

/// The largest summary that is read, bytes.
const MAX_BYTES: u64 = 1 << 24;
/// Digits of a build that tell it from another one.
const BUILD_DIGITS: usize = 12;

/// What is read of `summary.json`. A key that is missing there is left out of the table.
#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Summary {
    version: Option<String>,
    machine: Machine,
    scans_in_recording: Option<u64>,
    resumed_after: Option<u64>,
    processed: Option<u64>,
    dropped: Option<u64>,
    unreadable: Option<u64>,
    missing: Option<u64>,
    breaks: Option<u64>,
    motions: Option<Motions>,
    wall_s: Option<f64>,
    scans_per_s: Option<f64>,
    restarts: BTreeMap<String, u64>,
    latency: Latency,
    evaluation: Option<Evaluation>,
    slam: Option<Slam>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Machine {
    processor: Option<String>,
    cores: Option<u64>,
}

#[derive(Debug, Deserialize)]
struct Motions {
    refined: u64,
    weak: u64,
    predicted: u64,
    stationary: u64,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Latency {
    sensor_to_pose: Percentiles,
    bound_by: Option<String>,
}

#[derive(Debug, Default, Deserialize)]
#[serde(default)]
struct Percentiles {
    p50_us: Option<f64>,
    p99_us: Option<f64>,
}

#[derive(Debug, Deserialize)]
struct Evaluation {
    path_m: f64,
    ate: Ate,
    kitti: Option<Kitti>,
    seg: Option<Seg>,
    rpe: Option<Rpe>,
}

#[derive(Debug, Deserialize)]
struct Ate {
    rmse_m: f64,
    max_m: f64,
}

#[derive(Debug, Deserialize)]
struct Kitti {
    translation_percent: f64,
    rotation_deg_per_100m: f64,
}

#[derive(Debug, Deserialize)]
struct Seg {
    percent: f64,
}

#[derive(Debug, Deserialize)]
struct Rpe {
    translation_rmse_m: f64,
    rotation_rmse_deg: f64,
}

#[derive(Debug, Deserialize)]
struct Slam {
    keyframes: u64,
    loops_used: u64,
    loops_rejected: u64,
    ate_m: Option<f64>,
}

/// Reads the results of a complete run.
///
/// # Errors
/// Results that cannot be read.
pub(super) fn results(out: &Path) -> Result<(Figures, Times), BatchError> {
    let path = out.join("summary.json");
    let text = gyre_storage::read_text(&path, MAX_BYTES).map_err(BatchError::file(&path))?;
    let unknown = |error: serde_json::Error| BatchError::Unknown {
        path: path.clone(),
        reason: error.to_string(),
    };
    let summary: Summary = serde_json::from_str(&text).map_err(unknown)?;
    let mut figures = figures(&summary);
    figures.build = build(out)?;
    if summary.processed.is_some_and(|poses| poses > 1) {
        let (duration_s, path_m) = driven(&out.join("trajectory.tum"))?;
        figures.duration_s = Some(rounded(duration_s));
        figures.path_m = Some(rounded(path_m));
    }
    Ok((figures, times(summary)))
}

fn figures(summary: &Summary) -> Figures {
    let motions = summary.motions.as_ref();
    let (evaluation, slam) = (summary.evaluation.as_ref(), summary.slam.as_ref());
    let kitti = evaluation.and_then(|it| it.kitti.as_ref());
    let rpe = evaluation.and_then(|it| it.rpe.as_ref());
    let seg = evaluation.and_then(|it| it.seg.as_ref());
    Figures {
        version: summary.version.clone(),
        scans: summary.scans_in_recording,
        poses: summary.processed,
        dropped: summary.dropped,
        unreadable: summary.unreadable,
        missing: summary.missing,
        breaks: summary.breaks,
        refined: motions.map(|it| it.refined),
        weak: motions.map(|it| it.weak),
        predicted: motions.map(|it| it.predicted),
        stationary: motions.map(|it| it.stationary),
        truth_path_m: evaluation.map(|it| rounded(it.path_m)),
        ate_rmse_m: evaluation.map(|it| rounded(it.ate.rmse_m)),
        ate_max_m: evaluation.map(|it| rounded(it.ate.max_m)),
        kitti_translation_percent: kitti.map(|it| rounded(it.translation_percent)),
        kitti_rotation_deg_per_100m: kitti.map(|it| rounded(it.rotation_deg_per_100m)),
        seg_percent: seg.map(|it| rounded(it.percent)),
        rpe_translation_rmse_m: rpe.map(|it| rounded(it.translation_rmse_m)),
        rpe_rotation_rmse_deg: rpe.map(|it| rounded(it.rotation_rmse_deg)),
        keyframes: slam.map(|it| it.keyframes),
        loops_used: slam.map(|it| it.loops_used),
        loops_rejected: slam.map(|it| it.loops_rejected),
        slam_ate_rmse_m: slam.and_then(|it| it.ate_m).map(rounded),
        ..Figures::default()
    }
}

fn times(summary: Summary) -> Times {
    let percentiles = &summary.latency.sensor_to_pose;
    Times {
        cores: summary.machine.cores,
        resumed_after: summary.resumed_after,
        wall_s: summary.wall_s.map(rounded),
        scans_per_s: summary.scans_per_s.map(rounded),
        restarts: Some(summary.restarts.values().sum()),
        sensor_to_pose_p50_ms: percentiles.p50_us.map(|us| rounded(us * 1e-3)),
        sensor_to_pose_p99_ms: percentiles.p99_us.map(|us| rounded(us * 1e-3)),
        processor: summary.machine.processor,
        bound_by: summary.latency.bound_by,
    }
}

/// Returns the time and the length of a trajectory, s and m.
fn driven(path: &Path) -> Result<(f64, f64), BatchError> {
    let unknown = |reason: String| BatchError::Unknown {
        path: path.to_owned(),
        reason,
    };
    let trajectory = read_trajectory(path).map_err(|error| unknown(error.to_string()))?;
    let stamps = trajectory.stamp_ns.as_deref().unwrap_or_default();
    let ([first, ..], [.., last]) = (stamps, stamps) else {
        return Err(unknown("it has no stamps".to_owned()));
    };
    Ok(((last - first) as f64 * 1e-9, path_m(&trajectory.poses)))
}

/// Returns the first digits of the build that began the run.
fn build(out: &Path) -> Result<Option<String>, BatchError> {
    let text = optional_text(&out.join(gyre_stage::run::BEGUN_WITH))?;
    let identity: Option<toml::Table> = text.and_then(|text| text.parse().ok());
    let build = identity
        .as_ref()
        .and_then(|it| it.get("programs")?.get("build")?.as_str());
    Ok(build.map(|build| build.chars().take(BUILD_DIGITS).collect()))
}

/// Reads a file that need not be there.
pub(super) fn optional_text(path: &Path) -> Result<Option<String>, BatchError> {
    match gyre_storage::read_text(path, MAX_BYTES) {
        Ok(text) => Ok(Some(text)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(BatchError::file(path)(error)),
    }
}

/// Rounds to a hundred-thousandth, which is finer than any figure is exact.
fn rounded(value: f64) -> f64 {
    (value * 1e5).round() / 1e5
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::fs;

    use super::*;

    const SUMMARY: &str = r#"{
        "version": "0.1.0", "machine": {"processor": "CPU", "cores": 2}, "scans_in_recording": 3, "resumed_after": 1,
        "published": 3, "processed": 3, "dropped": 0, "unreadable": 0, "missing": 0, "breaks": 0,
        "wall_s": 0.5, "scans_per_s": 4.0, "restarts": {"masking": 2, "refinement": 1},
        "latency": {"sensor_to_pose": {"p50_us": 1500.0, "p99_us": 2500.0}, "bound_by": "masking"},
        "evaluation": {"path_m": 2.0, "ate": {"rmse_m": 0.1234567, "max_m": 0.2}, "kitti": null, "seg": null, "rpe": null}
    }"#;

    fn run(summary: &str) -> tempfile::TempDir {
        let out = tempfile::tempdir().unwrap();
        fs::write(out.path().join("summary.json"), summary).unwrap();
        let poses = "10.0 0 0 0 0 0 0 1\n10.25 1 0 0 0 0 0 1\n10.5 1 2 0 0 0 0 1\n";
        fs::write(out.path().join("trajectory.tum"), poses).unwrap();
        out
    }

    #[test]
    fn figures_are_those_of_the_run_and_its_trajectory() {
        let (figures, times) = results(run(SUMMARY).path()).unwrap();
        assert_eq!(figures.duration_s, Some(0.5));
        assert_eq!(figures.path_m, Some(3.0));
        assert_eq!(figures.ate_rmse_m, Some(0.12346));
        assert_eq!(figures.kitti_translation_percent, None);
        assert_eq!(figures.loops_used, None);
        assert_eq!(times.restarts, Some(3));
        assert_eq!(times.scans_per_s, Some(4.0));
        assert_eq!(times.sensor_to_pose_p99_ms, Some(2.5));
    }

    #[test]
    fn a_run_of_one_pose_has_no_path() {
        let out = run(&SUMMARY.replace("\"processed\": 3", "\"processed\": 1"));
        fs::remove_file(out.path().join("trajectory.tum")).unwrap();
        let (figures, _) = results(out.path()).unwrap();
        assert_eq!((figures.poses, figures.path_m), (Some(1), None));
    }

    #[test]
    fn a_summary_that_is_none_is_refused() {
        let error = results(run("{\"processed\": []}").path()).unwrap_err();
        assert!(
            error.to_string().contains("summary.json is not what"),
            "{error}"
        );
    }
}
