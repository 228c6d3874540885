//! The columns of the table: names, and the places of their values in a run's `summary.json`.

use std::{collections::BTreeMap, io, path::Path};

use gyre_datasets::ground_truth::read_trajectory;
use gyre_evaluation::path_m;
use serde_json::Value;

use crate::BatchError;

/// A column: its name, and the JSON pointer into the summary; empty: [`derived`].
pub(crate) type Column = (&'static str, &'static str);
/// The values of a drive by column. A column without a value is left out.
pub type Values = BTreeMap<String, Value>;

/// The columns of `results.csv` after outcome and sentence. On one kind of processor the same scans
/// and configuration give the same, whatever was killed on the way.
pub(crate) const FIGURES: [Column; 26] = [
    ("version", "/version"),
    ("build", ""),
    ("scans", "/scans_in_recording"),
    ("poses", "/processed"),
    ("dropped", "/dropped"),
    ("unreadable", "/unreadable"),
    ("missing", "/missing"),
    ("breaks", "/breaks"),
    ("duration_s", ""),
    ("path_m", ""),
    ("refined", "/motions/refined"),
    ("weak", "/motions/weak"),
    ("predicted", "/motions/predicted"),
    ("stationary", "/motions/stationary"),
    ("truth_path_m", "/evaluation/path_m"),
    ("ate_rmse_m", "/evaluation/ate/rmse_m"),
    ("ate_max_m", "/evaluation/ate/max_m"),
    (
        "kitti_translation_percent",
        "/evaluation/kitti/translation_percent",
    ),
    (
        "kitti_rotation_deg_per_100m",
        "/evaluation/kitti/rotation_deg_per_100m",
    ),
    ("seg_percent", "/evaluation/seg/percent"),
    (
        "rpe_translation_rmse_m",
        "/evaluation/rpe/translation_rmse_m",
    ),
    ("rpe_rotation_rmse_deg", "/evaluation/rpe/rotation_rmse_deg"),
    ("keyframes", "/slam/keyframes"),
    ("loops_used", "/slam/loops_used"),
    ("loops_rejected", "/slam/loops_rejected"),
    ("slam_ate_rmse_m", "/slam/ate_m"),
];
/// The columns of `times.csv`: they depend on the computer, and on what was killed.
pub(crate) const TIMES: [Column; 9] = [
    ("processor", "/machine/processor"),
    ("cores", "/machine/cores"),
    ("resumed_after", "/resumed_after"),
    ("wall_s", "/wall_s"),
    ("scans_per_s", "/scans_per_s"),
    ("restarts", ""),
    ("sensor_to_pose_p50_ms", ""),
    ("sensor_to_pose_p99_ms", ""),
    ("bound_by", "/latency/bound_by"),
];

/// The largest summary that is read, bytes.
const MAX_BYTES: u64 = 1 << 24;
/// Digits of a build that tell it from another one.
const BUILD_DIGITS: usize = 12;

/// Reads the results of a complete run: figures and times.
///
/// # Errors
/// Results that cannot be read.
pub(crate) fn read(out: &Path) -> Result<(Values, Values), BatchError> {
    let path = out.join("summary.json");
    let text = gyre_storage::read_text(&path, MAX_BYTES).map_err(BatchError::file(&path))?;
    let summary: Value = serde_json::from_str(&text).map_err(unknown(&path))?;
    let derived = derived(out, &summary)?;
    let values = |columns: &[Column]| -> Result<Values, BatchError> {
        let value = |(name, pointer): &Column| {
            let value = match *pointer {
                "" => derived.get(*name),
                pointer => summary.pointer(pointer),
            };
            let rounded = match value.unwrap_or(&Value::Null) {
                Value::Null => return None,
                Value::String(text) => Ok(text.as_str().into()),
                Value::Number(number) if !number.is_f64() => Ok(number.clone().into()),
                Value::Number(number) => Ok(rounded(number.as_f64().unwrap_or_default()).into()),
                _ => Err(unknown(&path)(format!("`{pointer}` is no figure"))),
            };
            Some(rounded.map(|value| ((*name).to_owned(), value)))
        };
        columns.iter().filter_map(value).collect()
    };
    Ok((values(&FIGURES)?, values(&TIMES)?))
}

/// Returns the values that are computed from results, by column.
fn derived(out: &Path, summary: &Value) -> Result<BTreeMap<&'static str, Value>, BatchError> {
    let ms = |percentile: &str| {
        let us = &summary["latency"]["sensor_to_pose"][percentile];
        us.as_f64().map(|us| us * 1e-3).into()
    };
    let restarts = summary["restarts"].as_object().into_iter().flatten();
    let restarts: u64 = restarts.filter_map(|(_, count)| count.as_u64()).sum();
    let mut derived = BTreeMap::from([
        ("build", build(out)?.into()),
        ("restarts", restarts.into()),
        ("sensor_to_pose_p50_ms", ms("p50_us")),
        ("sensor_to_pose_p99_ms", ms("p99_us")),
    ]);
    if summary["processed"].as_u64() > Some(1) {
        let (duration_s, path_m) = driven(&out.join("trajectory.tum"))?;
        derived.extend([("duration_s", duration_s.into()), ("path_m", path_m.into())]);
    }
    Ok(derived)
}

/// Returns the time and the length of a trajectory, s and m.
fn driven(path: &Path) -> Result<(f64, f64), BatchError> {
    let trajectory = read_trajectory(path).map_err(unknown(path))?;
    let stamps = trajectory.stamp_ns.as_deref().unwrap_or_default();
    let ([first, ..], [.., last]) = (stamps, stamps) else {
        return Err(unknown(path)("it has no stamps"));
    };
    Ok(((last - first) as f64 * 1e-9, path_m(&trajectory.poses)))
}

/// Returns the first digits of the build that began the run.
fn build(out: &Path) -> Result<Option<String>, BatchError> {
    let text = optional_text(&out.join(gyre_run::BEGUN_WITH))?;
    let identity: Option<toml::Table> = text.and_then(|text| text.parse().ok());
    let build = identity
        .as_ref()
        .and_then(|it| it.get("programs")?.get("build")?.as_str());
    Ok(build.map(|build| build.chars().take(BUILD_DIGITS).collect()))
}

/// Reads a file that need not be there.
pub(crate) fn optional_text(path: &Path) -> Result<Option<String>, BatchError> {
    match gyre_storage::read_text(path, MAX_BYTES) {
        Ok(text) => Ok(Some(text)),
        Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(None),
        Err(error) => Err(BatchError::file(path)(error)),
    }
}

/// Returns a function that makes an error of a file's content of its reason.
pub(crate) fn unknown<E: ToString>(path: &Path) -> impl Fn(E) -> BatchError {
    let path = path.to_owned();
    move |reason| BatchError::Unknown {
        path: path.clone(),
        reason: reason.to_string(),
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
        let (figures, times) = read(run(SUMMARY).path()).unwrap();
        assert_eq!(figures["duration_s"], 0.5);
        assert_eq!(figures["path_m"], 3.0);
        assert_eq!(figures["ate_rmse_m"], 0.12346);
        assert_eq!(figures.get("kitti_translation_percent"), None);
        assert_eq!(figures.get("loops_used"), None);
        assert_eq!(times["restarts"], 3);
        assert_eq!(times["scans_per_s"], 4.0);
        assert_eq!(times["sensor_to_pose_p99_ms"], 2.5);
    }

    #[test]
    fn a_run_of_one_pose_has_no_path() {
        let out = run(&SUMMARY.replace("\"processed\": 3", "\"processed\": 1"));
        fs::remove_file(out.path().join("trajectory.tum")).unwrap();
        let (figures, _) = read(out.path()).unwrap();
        assert_eq!(figures["poses"], 1);
        assert_eq!(figures.get("path_m"), None);
    }

    #[test]
    fn a_summary_that_is_none_is_refused() {
        let error = read(run("{\"processed\": []}").path()).unwrap_err();
        assert!(
            error.to_string().contains("summary.json is not what"),
            "{error}"
        );
    }
}
