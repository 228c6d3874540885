//! What is kept of a drive: `rows/NAME.json`, which the table is made of.

mod read;

use std::path::{Path, PathBuf};

use gyre_stage::run::COMPLETE;
use serde::{Deserialize, Serialize};

use crate::{BatchError, Drive, Outcome};

/// The version of the file. It is raised when a key changes its meaning or goes.
const VERSION: u32 = 1;

/// What the drives of a batch have in common.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// The configuration of the drives that name none and are none, an absolute path; `None`: by their formats and scans.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub configuration: Option<PathBuf>,
    /// Overrides of each configuration, `section.key=value`. Those of a drive hold over them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub set: Vec<String>,
}

/// How a drive has ended, and its results.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    version: u32,
    /// The drive.
    pub drive: Drive,
    /// What else it was computed with.
    pub settings: Settings,
    /// How it has ended.
    pub outcome: Outcome,
    /// Why it is not complete, in a sentence; else empty.
    pub sentence: String,
    /// What follows from its scans and its configuration; empty unless all scans were played.
    pub figures: Figures,
    /// What does not: times, restarts, the computer.
    pub times: Times,
}

/// Results of a drive. On one kind of processor the same scans and configuration give the same, whatever was killed on the way.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Figures {
    /// Gyre's version.
    pub version: Option<String>,
    /// SHA-256 of the program that began the run, its first twelve digits.
    pub build: Option<String>,
    /// Scans to play.
    pub scans: Option<u64>,
    /// Scans with a pose.
    pub poses: Option<u64>,
    /// Scans that live mode has dropped.
    pub dropped: Option<u64>,
    /// Scans that cannot be read.
    pub unreadable: Option<u64>,
    /// Scans that the recording lacks, by its stamps.
    pub missing: Option<u64>,
    /// Places where the chain of motions starts anew.
    pub breaks: Option<u64>,
    /// From the first pose to the last, s.
    pub duration_s: Option<f64>,
    /// Length of the estimated path, m.
    pub path_m: Option<f64>,
    /// Motions that were refined.
    pub refined: Option<u64>,
    /// Motions with little support.
    pub weak: Option<u64>,
    /// Motions that nothing matched.
    pub predicted: Option<u64>,
    /// Motions of a standing vehicle.
    pub stationary: Option<u64>,
    /// Length of the true path, m. This and what follows, up to the loops, needs ground truth.
    pub truth_path_m: Option<f64>,
    /// Absolute trajectory error, m: root of the mean square.
    pub ate_rmse_m: Option<f64>,
    /// The largest, m.
    pub ate_max_m: Option<f64>,
    /// KITTI odometry error, %; needs 100 m.
    pub kitti_translation_percent: Option<f64>,
    /// KITTI odometry error of the heading, degrees in 100 m.
    pub kitti_rotation_deg_per_100m: Option<f64>,
    /// Segment error, %; needs 100 m.
    pub seg_percent: Option<f64>,
    /// Error of a motion, m: root of the mean square.
    pub rpe_translation_rmse_m: Option<f64>,
    /// The same of its rotation, degrees.
    pub rpe_rotation_rmse_deg: Option<f64>,
    /// Keyframes, with SLAM.
    pub keyframes: Option<u64>,
    /// Loops that the corrected trajectory is made with.
    pub loops_used: Option<u64>,
    /// Loops that contradict the others.
    pub loops_rejected: Option<u64>,
    /// Absolute trajectory error of the corrected trajectory, m.
    pub slam_ate_rmse_m: Option<f64>,
}

/// Times of a drive, and what else depends on the computer and on what was killed.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Times {
    /// The processor's model.
    pub processor: Option<String>,
    /// Processors that the run was allowed to use.
    pub cores: Option<u64>,
    /// Poses that an earlier session had computed.
    pub resumed_after: Option<u64>,
    /// Time of the last session, s.
    pub wall_s: Option<f64>,
    /// Scans of the last session in a second.
    pub scans_per_s: Option<f64>,
    /// Restarts of stages in the last session.
    pub restarts: Option<u64>,
    /// From the completion of a scan to its pose, the median, ms.
    pub sensor_to_pose_p50_ms: Option<f64>,
    /// The same, of 99 in 100 scans.
    pub sensor_to_pose_p99_ms: Option<f64>,
    /// The stage that worked most of the time.
    pub bound_by: Option<String>,
}

impl Row {
    /// The row of a drive that has ended, whose run has left its results in `out`.
    pub fn of(
        drive: &Drive,
        settings: &Settings,
        outcome: Outcome,
        sentence: String,
        out: &Path,
    ) -> Self {
        let row = Self {
            sentence,
            ..Self::without_results(drive, settings, outcome)
        };
        if !outcome.has_results() {
            return row;
        }
        match read::results(out) {
            Ok((figures, times)) => Self {
                figures,
                times,
                ..row
            },
            Err(error) => Self {
                outcome: Outcome::Failed,
                sentence: error.to_string(),
                ..row
            },
        }
    }

    /// The row of a drive that nobody has computed yet.
    pub fn not_run(drive: &Drive, settings: &Settings, sentence: &str) -> Self {
        Self {
            sentence: sentence.to_owned(),
            ..Self::without_results(drive, settings, Outcome::NotRun)
        }
    }

    fn without_results(drive: &Drive, settings: &Settings, outcome: Outcome) -> Self {
        Self {
            version: VERSION,
            drive: drive.clone(),
            settings: settings.clone(),
            outcome,
            sentence: String::new(),
            figures: Figures::default(),
            times: Times::default(),
        }
    }

    /// Returns the file of a drive in the folder of a batch.
    pub fn path(batch: &Path, drive: &Drive) -> PathBuf {
        batch.join("rows").join(format!("{}.json", drive.name))
    }

    /// Writes it as a whole, so that it is there or not, whatever is killed.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn write(&self, batch: &Path) -> Result<(), BatchError> {
        let path = Self::path(batch, &self.drive);
        let text = serde_json::to_string_pretty(self).map_err(|error| BatchError::Unknown {
            path: path.clone(),
            reason: error.to_string(),
        })?;
        Ok(gyre_storage::write(&path, text)?)
    }

    /// Reads that of a drive; `None`: there is none.
    ///
    /// # Errors
    /// A file that cannot be read, or that is none of this version.
    pub fn read(batch: &Path, drive: &Drive) -> Result<Option<Self>, BatchError> {
        let path = Self::path(batch, drive);
        let Some(text) = read::optional_text(&path)? else {
            return Ok(None);
        };
        let unknown = |reason: String| BatchError::Unknown {
            path: path.clone(),
            reason,
        };
        let row: Self = serde_json::from_str(&text).map_err(|error| unknown(error.to_string()))?;
        match row.version {
            VERSION => Ok(Some(row)),
            version => Err(unknown(format!("version {version}"))),
        }
    }

    /// Reads that of a drive with these settings whose results are there; `None`: there are none, or they are being computed anew.
    ///
    /// # Errors
    /// A file that cannot be read.
    pub fn of_results(
        batch: &Path,
        drive: &Drive,
        settings: &Settings,
    ) -> Result<Option<Self>, BatchError> {
        let row = match Self::read(batch, drive) {
            Err(BatchError::Unknown { .. }) => None,
            read => read?,
        };
        let is_whole = |row: &Self| {
            row.is_of(drive, settings) && row.outcome.has_results() && row.has_its_results(batch)
        };
        Ok(row.filter(is_whole))
    }

    /// Returns whether the results that it is of are there. A run that begins anew removes them.
    pub(crate) fn has_its_results(&self, batch: &Path) -> bool {
        let results = batch.join("drives").join(&self.drive.name);
        results.join(COMPLETE).exists()
    }

    /// Returns whether it is of this drive with these settings.
    pub fn is_of(&self, drive: &Drive, settings: &Settings) -> bool {
        (&self.drive, &self.settings) == (drive, settings)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::fs;

    use super::*;

    fn drive() -> Drive {
        Drive {
            name: "a".to_owned(),
            path: "data/a".to_owned(),
            configuration: None,
            set: vec!["raster.n=127".to_owned()],
        }
    }

    #[test]
    fn a_row_is_read_as_it_was_written_and_a_part_of_one_is_refused() {
        let batch = tempfile::tempdir().unwrap();
        fs::create_dir(batch.path().join("rows")).unwrap();
        assert_eq!(Row::read(batch.path(), &drive()).unwrap(), None);
        let mut row = Row::not_run(&drive(), &Settings::default(), "not yet");
        row.figures.ate_rmse_m = Some(0.0123);
        row.write(batch.path()).unwrap();
        assert_eq!(Row::read(batch.path(), &drive()).unwrap().unwrap(), row);

        let path = Row::path(batch.path(), &drive());
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, &text[..text.len() / 2]).unwrap();
        let error = Row::read(batch.path(), &drive()).unwrap_err().to_string();
        assert!(error.contains("a.json is not what"), "{error}");
    }

    #[test]
    fn a_row_of_other_settings_is_not_that_of_the_drive() {
        let settings = Settings {
            set: vec!["slam.kind=graph".to_owned()],
            ..Settings::default()
        };
        let row = Row::not_run(&drive(), &settings, "");
        assert!(row.is_of(&drive(), &settings));
        assert!(!row.is_of(&drive(), &Settings::default()));
    }

    #[test]
    fn a_complete_drive_without_its_results_is_a_failure() {
        let out = tempfile::tempdir().unwrap();
        let settings = Settings::default();
        let sentence = String::new();
        let row = Row::of(&drive(), &settings, Outcome::Complete, sentence, out.path());
        assert_eq!(row.outcome, Outcome::Failed);
        assert!(row.sentence.contains("summary.json"), "{}", row.sentence);
    }
}
