//! The columns of the table: names, and the places of their values in a run's `summary.json`.

use std::{collections::BTreeMap, fmt::Display, path::Path};

use gyre_datasets::ground_truth::read_trajectory;
use gyre_evaluation::path_m;
use gyre_storage::{SETTINGS, read_text};
use gyre_terminal::Failure;
use serde_json::{Map, Value, json};

/// A column: its name, and the JSON pointer into the summary; under `/derived` is a value that
/// [`read`] adds.
pub(crate) type Column = (&'static str, &'static str);
/// The values of a drive by column. A column without a value is left out.
pub type Values = BTreeMap<String, Value>;

/// The columns of `results.csv` after outcome and sentence. On one kind of processor the same scans
/// and configuration give the same, whatever was killed meanwhile.
#[rustfmt::skip]
pub(crate) const FIGURES: [Column; 26] = [
    ("version", "/version"),
    ("build", "/derived/build"),
    ("scans", "/scans_in_recording"),
    ("poses", "/processed"),
    ("dropped", "/dropped"),
    ("unreadable", "/unreadable"),
    ("missing", "/missing"),
    ("breaks", "/breaks"),
    ("duration_s", "/derived/duration_s"),
    ("path_m", "/derived/path_m"),
    ("refined", "/motions/refined"),
    ("weak", "/motions/weak"),
    ("predicted", "/motions/predicted"),
    ("stationary", "/motions/stationary"),
    ("truth_path_m", "/evaluation/path_m"),
    ("ate_rmse_m", "/evaluation/ate/rmse_m"),
    ("ate_max_m", "/evaluation/ate/max_m"),
    ("kitti_translation_percent", "/evaluation/kitti/translation_percent"),
    ("kitti_rotation_deg_per_100m", "/evaluation/kitti/rotation_deg_per_100m"),
    ("seg_percent", "/evaluation/seg/percent"),
    ("rpe_translation_rmse_m", "/evaluation/rpe/translation_rmse_m"),
    ("rpe_rotation_rmse_deg", "/evaluation/rpe/rotation_rmse_deg"),
    ("keyframes", "/slam/keyframes"),
    ("loops_used", "/slam/loops_used"),
    ("loops_rejected", "/slam/loops_rejected"),
    ("slam_ate_rmse_m", "/slam/ate_m"),
];
/// The columns of `times.csv`: they depend on the computer and on kills.
pub(crate) const TIMES: [Column; 9] = [
    ("processor", "/machine/processor"),
    ("cores", "/machine/cores"),
    ("resumed_after", "/resumed_after"),
    ("wall_s", "/wall_s"),
    ("scans_per_s", "/scans_per_s"),
    ("restarts", "/derived/restarts"),
    ("sensor_to_pose_p50_ms", "/derived/p50_ms"),
    ("sensor_to_pose_p99_ms", "/derived/p99_ms"),
    ("bound_by", "/latency/bound_by"),
];

/// Digits of a build that distinguish it.
const BUILD_DIGITS: usize = 12;

/// Reads the figures of a run that has played all scans, and why they are unreliable, if they are.
pub(crate) fn read(out: &Path) -> Result<(Values, Option<String>), Failure> {
    let path = out.join("summary.json");
    let text = read_text(&path, SETTINGS)
        .map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    let summary = serde_json::from_str::<Map<String, Value>>(&text);
    let mut summary = Value::Object(summary.map_err(|error| unknown(&path, error))?);
    let problem = summary["problem"].as_str().map(str::to_owned);
    let ms = |percentile| Some(summary.pointer(percentile)?.as_f64()? * 1e-3);
    let restarts = summary["restarts"].as_object().into_iter().flatten();
    let restarts: u64 = restarts.filter_map(|(_, count)| count.as_u64()).sum();
    let trajectory = read_trajectory(&out.join("trajectory.tum")).ok();
    let trajectory = trajectory.filter(|it| it.poses.len() > 1);
    let span_ns = trajectory.as_ref().and_then(|it| it.span_ns());
    let begun = read_text(&out.join(gyre_run::BEGUN_WITH), SETTINGS).ok();
    let begun: Option<toml::Table> = begun.and_then(|text| text.parse().ok());
    let build = |begun: &toml::Table| {
        let build = begun.get("programs")?.get("build")?.as_str()?;
        Some(build.get(..BUILD_DIGITS)?.to_owned())
    };
    summary["derived"] = json!({
        "build": begun.as_ref().and_then(build),
        "restarts": restarts,
        "p50_ms": ms("/latency/sensor_to_pose/p50_us"),
        "p99_ms": ms("/latency/sensor_to_pose/p99_us"),
        "duration_s": span_ns.map(|(first, last)| (last - first) as f64 * 1e-9),
        "path_m": trajectory.map(|it| path_m(&it.poses)),
    });
    let mut values = Values::new();
    for (name, pointer) in FIGURES.iter().chain(&TIMES) {
        let value = match summary.pointer(pointer) {
            None | Some(Value::Null) => continue,
            // Rounded to a hundred-thousandth, which is finer than any figure is exact.
            Some(Value::Number(number)) if number.is_f64() => {
                ((number.as_f64().unwrap_or_default() * 1e5).round() / 1e5).into()
            }
            Some(value @ (Value::String(_) | Value::Number(_))) => value.clone(),
            Some(_) => return Err(unknown(&path, format!("`{pointer}` is no figure")).into()),
        };
        values.insert((*name).to_owned(), value);
    }
    Ok((values, problem))
}

/// Returns a sentence about a file with an invalid content.
pub(crate) fn unknown(path: &Path, reason: impl Display) -> String {
    let path = path.display();
    format!(
        "{path} is not what this version of gyre writes ({reason}); remove it, and the same command makes it again"
    )
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
    fn values_are_those_of_the_run_and_its_trajectory() {
        let (values, problem) = read(run(SUMMARY).path()).unwrap();
        assert_eq!(problem, None);
        assert_eq!(values["duration_s"], 0.5);
        assert_eq!(values["path_m"], 3.0);
        assert_eq!(values["ate_rmse_m"], 0.12346);
        assert_eq!(values.get("kitti_translation_percent"), None);
        assert_eq!(values.get("loops_used"), None);
        assert_eq!(values["restarts"], 3);
        assert_eq!(values["scans_per_s"], 4.0);
        assert_eq!(values["sensor_to_pose_p99_ms"], 2.5);
    }

    #[test]
    fn a_run_of_one_pose_has_no_path_and_an_invalid_summary_is_refused() {
        let out = run(&SUMMARY.replace("\"processed\": 3", "\"processed\": 1"));
        fs::remove_file(out.path().join("trajectory.tum")).unwrap();
        let (values, _) = read(out.path()).unwrap();
        assert_eq!((&values["poses"], values.get("path_m")), (&json!(1), None));
        for summary in ["{\"processed\": []}", "[]", "3"] {
            let error = read(run(summary).path()).unwrap_err().to_string();
            assert!(error.contains("summary.json is not what"), "{error}");
        }
    }
}
