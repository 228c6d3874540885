//! The end of a drive, and its row: `rows/NAME.json`. The table of a batch, which is its rows:
//! `results.csv` and, drive by drive in the same order, `times.csv`; the columns, and the places of
//! their values in a run's `summary.json`.

use std::{
    collections::BTreeMap,
    fmt::{self, Display},
    path::{Path, PathBuf},
};

use gyre_configuration::terminal::Failure;
use gyre_contract::run::COMPLETE;
use gyre_datasets::ground_truth::read_trajectory;
use gyre_results::{HARDLY_MEASURED, evaluation::path_m};
use gyre_storage::{SETTINGS, read_text};
use serde::{Deserialize, Serialize, de::DeserializeOwned};
use serde_json::{Value, json};

use crate::batch::Drive;

/// The file of the results that follow from the drives and their configurations: the same bytes
/// whatever was killed.
pub const RESULTS: &str = "results.csv";
pub const TIMES_FILE: &str = "times.csv";

/// A column: its name, and the JSON pointer into the summary; under `/derived` is a value that
/// [`values`] adds.
type Column = (&'static str, &'static str);
/// The values of a drive by column. A column without a value is left out.
pub type Values = BTreeMap<String, Value>;

/// The columns of `results.csv` after outcome and sentence. On one kind of processor the same scans
/// and configuration give the same, whatever was killed meanwhile.
#[rustfmt::skip]
const FIGURES: [Column; 26] = [
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
const TIMES: [Column; 9] = [
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

/// The outcome of a drive: the column `outcome` of the table.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Outcome {
    /// All scans have been played, and all results are there.
    Complete,
    /// All scans have been played, but too many of them cannot be read.
    Corrupt,
    /// All scans have been played, but too many of the motions are weak or predicted.
    Unsure,
    /// The run could not begin, or has failed.
    Failed,
    Killed,
    Interrupted,
    /// It has not been computed yet, or with other settings.
    NotRun,
}

impl Outcome {
    /// Returns whether all scans were played, so that there are results of the whole drive.
    pub fn has_results(self) -> bool {
        matches!(self, Self::Complete | Self::Corrupt | Self::Unsure)
    }
}

impl Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// The end of a drive's process: the last line that it prints, as JSON.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct End {
    /// `Complete` if all scans were played, whatever their results are worth.
    pub outcome: Outcome,
    /// True if earlier results of the drive still count: they are the same, or nobody could look.
    pub earlier: bool,
    /// The reason why it is not complete; else empty.
    pub sentence: String,
}

impl End {
    pub fn new(outcome: Outcome, earlier: bool, sentence: impl Into<String>) -> Self {
        Self {
            outcome,
            earlier,
            sentence: sentence.into(),
        }
    }

    pub fn interrupted() -> Self {
        let sentence = "the batch was interrupted: the same command continues";
        Self::new(Outcome::Interrupted, true, sentence)
    }
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    pub drive: Drive,
    pub outcome: Outcome,
    /// The reason why it is not complete, in a sentence; else empty.
    pub sentence: String,
    /// The values of both tables by column; empty unless all scans were played.
    pub values: Values,
}

impl Row {
    /// The row of a drive that has ended in the folder of a batch.
    pub fn of(batch: &Path, drive: &Drive, outcome: Outcome, sentence: impl Into<String>) -> Self {
        let (values, problem) = match outcome {
            Outcome::Complete => match values(&Self::results(batch, drive)) {
                Ok(read) => read,
                Err(error) => return Self::of(batch, drive, Outcome::Failed, error),
            },
            _ => (Values::new(), None),
        };
        let outcome = match &problem {
            None => outcome,
            Some(problem) if problem.contains(HARDLY_MEASURED) => Outcome::Unsure,
            Some(_) => Outcome::Corrupt,
        };
        let sentence = problem.unwrap_or_else(|| sentence.into());
        Self {
            drive: drive.clone(),
            outcome,
            // Without the place of the batch the table is the same in each place.
            sentence: sentence.replace(&format!("{}/", batch.display()), ""),
            values,
        }
    }

    pub fn results(batch: &Path, drive: &Drive) -> PathBuf {
        batch.join("drives").join(&drive.name)
    }

    fn path(batch: &Path, drive: &Drive) -> PathBuf {
        batch.join("rows").join(format!("{}.json", drive.name))
    }

    /// Writes it as a whole, so that it is there or not, whatever is killed.
    pub fn write(&self, batch: &Path) -> Result<(), Failure> {
        let text = serde_json::to_string_pretty(self)?;
        Ok(gyre_storage::write(&Self::path(batch, &self.drive), text)?)
    }

    /// Reads the row of a drive with these settings, whose results are there if it had any. Without
    /// one the outcome is `not-run`.
    pub fn read(batch: &Path, drive: &Drive) -> Self {
        let path = Self::path(batch, drive);
        let has_results = || Self::results(batch, drive).join(COMPLETE).exists();
        let reason = match read_json::<Self>(&path) {
            _ if !path.exists() => "it has not been computed yet".to_owned(),
            Err(reason) => reason,
            Ok(row) if row.drive != *drive => "it was computed with other settings".to_owned(),
            // A run that begins removes the results before it.
            Ok(row) if row.outcome.has_results() && !has_results() => {
                "its results are being computed again, or were removed".to_owned()
            }
            Ok(row) => return row,
        };
        Self::of(batch, drive, Outcome::NotRun, reason)
    }

    /// Returns a line about it; `earlier`: the drive had ended so before.
    pub fn line(&self, earlier: bool) -> String {
        let (name, outcome) = (&self.drive.name, self.outcome);
        let earlier = if earlier { " before" } else { "" };
        match (outcome, self.values.get("poses")) {
            (Outcome::Complete, Some(poses)) => {
                let ate_m = self.values.get("ate_rmse_m").and_then(Value::as_f64);
                let ate = ate_m.map_or(String::new(), |ate_m| format!(", ATE {ate_m:.3} m"));
                format!("{name}: complete{earlier}, {poses} poses{ate}")
            }
            _ => format!("{name}: {outcome}{earlier}: {}", self.sentence),
        }
    }
}

/// Reads the figures of a run that has played all scans, and why they are unreliable, if they are.
fn values(out: &Path) -> Result<(Values, Option<String>), String> {
    let path = out.join("summary.json");
    let mut summary = read_json(&path).map(Value::Object)?;
    let problem = summary["problem"].as_str().map(str::to_owned);
    let ms = |percentile| Some(summary.pointer(percentile)?.as_f64()? * 1e-3);
    let restarts = summary["restarts"].as_object().into_iter().flatten();
    let restarts: u64 = restarts.filter_map(|(_, count)| count.as_u64()).sum();
    let trajectory = read_trajectory(&out.join("trajectory.tum")).ok();
    let trajectory = trajectory.filter(|it| it.poses.len() > 1);
    let span_ns = trajectory.as_ref().and_then(|it| it.span_ns());
    let begun = read_text(&out.join(gyre_contract::run::BEGUN_WITH), SETTINGS).ok();
    let begun: Option<toml::Table> = begun.and_then(|text| text.parse().ok());
    let build = |begun: &toml::Table| {
        let build = begun.get("programs")?.get("build")?.as_str()?;
        // So many digits distinguish it.
        Some(build.get(..12)?.to_owned())
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
            Some(_) => return Err(unknown(&path, format!("`{pointer}` is no figure"))),
        };
        values.insert((*name).to_owned(), value);
    }
    Ok((values, problem))
}

/// Reads a file that a batch or a run has written. The error is a sentence.
fn read_json<T: DeserializeOwned>(path: &Path) -> Result<T, String> {
    let text = read_text(path, SETTINGS);
    let text = text.map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    serde_json::from_str(&text).map_err(|error| unknown(path, error))
}

fn unknown(path: &Path, reason: impl Display) -> String {
    let path = path.display();
    format!(
        "{path} is not what this version of gyre writes ({reason}); remove it, and the same command makes it again"
    )
}

/// Writes both files from the rows of all drives.
pub fn write(rows: &[Row], out: &Path) -> Result<(), Failure> {
    let first = ["name", "drive", "outcome", "sentence"];
    gyre_storage::write(&out.join(RESULTS), csv(rows, &first, &FIGURES)?)?;
    let times = csv(rows, &["name"], &TIMES)?;
    Ok(gyre_storage::write(&out.join(TIMES_FILE), times)?)
}

fn csv(rows: &[Row], first: &[&str], columns: &[Column]) -> Result<Vec<u8>, Failure> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    let names = first.iter().copied().chain(columns.iter().map(|it| it.0));
    writer.write_record(names.clone())?;
    for row in rows {
        writer.write_record(names.clone().map(|name| cell(row, name)))?;
    }
    Ok(writer.into_inner()?)
}

fn cell(row: &Row, column: &str) -> String {
    match (column, row.values.get(column)) {
        ("name", _) => row.drive.name.clone(),
        ("drive", _) => row.drive.path.clone(),
        ("outcome", _) => row.outcome.to_string(),
        ("sentence", _) => row.sentence.clone(),
        (_, None) => String::new(),
        (_, Some(Value::String(text))) => text.clone(),
        (_, Some(other)) => other.to_string(),
    }
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;
    use crate::batch::List;

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
        let (values, problem) = values(run(SUMMARY).path()).unwrap();
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
        let (of_one, _) = values(out.path()).unwrap();
        assert_eq!((&of_one["poses"], of_one.get("path_m")), (&json!(1), None));
        for summary in ["{\"processed\": []}", "[]", "3"] {
            let error = values(run(summary).path()).unwrap_err();
            assert!(error.contains("summary.json is not what"), "{error}");
        }
    }

    #[test]
    fn the_table_has_a_line_for_each_drive_and_a_damaged_row_counts_as_not_run() {
        let folder = tempfile::tempdir().unwrap();
        let (out, path) = (folder.path(), folder.path().join("list.txt"));
        fs::write(&path, "b\na\nc\n").unwrap();
        let list = List::read(&path).unwrap();
        fs::create_dir(out.join("rows")).unwrap();
        let log = out.join("drives/a/log.jsonl");
        let sentence = format!("no {}", log.display());
        let mut row = Row::of(out, &list.drives[1], Outcome::NotRun, sentence);
        assert_eq!(row.sentence, "no drives/a/log.jsonl");
        row.outcome = Outcome::Complete;
        row.values.insert("ate_rmse_m".to_owned(), 0.25.into());
        row.write(out).unwrap();
        fs::create_dir_all(out.join("drives/a/journal")).unwrap();
        fs::write(out.join("drives/a/journal/complete"), "").unwrap();
        fs::write(out.join("rows/c.json"), "{").unwrap();
        let rows: Vec<_> = list.drives.iter().map(|it| Row::read(out, it)).collect();
        write(&rows, out).unwrap();
        assert_eq!(rows[1], row);
        let damaged = rows[2].line(false);
        assert!(damaged.starts_with("c: not-run") && damaged.contains("c.json is not what"));
        let results = fs::read_to_string(out.join(RESULTS)).unwrap();
        let names = results.lines().skip(1).map(|line| &line[..1]);
        assert_eq!(names.collect::<Vec<_>>(), ["b", "a", "c"]);
        assert!(results.contains(",0.25,"), "{results}");
    }
}
