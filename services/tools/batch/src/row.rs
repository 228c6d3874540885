//! The row of a drive: `rows/NAME.json`, which the table is made of.

use std::path::{Path, PathBuf};

use gyre_run::COMPLETE;
use serde::{Deserialize, Serialize};

use crate::{
    BatchError, Drive, DriveOutcome, Values,
    columns::{self, optional_text, unknown},
};

/// The version of the file. It is raised when a key changes its meaning or goes.
const VERSION: u32 = 1;

/// The settings that the drives of a batch have in common.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// The configuration of the drives that name none and are none, an absolute path; `None`: by
    /// their formats and scans.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub configuration: Option<PathBuf>,
    /// Overrides of each configuration, `section.key=value`. Those of a drive hold over them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub set: Vec<String>,
}

/// The outcome of a drive, and its results.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriveRow {
    version: u32,
    /// The drive.
    pub drive: Drive,
    /// The settings that it was computed with.
    pub settings: Settings,
    /// The outcome.
    pub outcome: DriveOutcome,
    /// The reason why it is not complete, in a sentence; else empty.
    pub sentence: String,
    /// The columns of `results.csv` that follow from its scans and its configuration; empty unless
    /// all scans were played.
    pub figures: Values,
    /// The columns of `times.csv`: times, restarts, the computer.
    pub times: Values,
}

impl DriveRow {
    /// The row of a drive that has ended, whose run has left its results in `out`.
    pub fn of(
        drive: &Drive,
        settings: &Settings,
        outcome: DriveOutcome,
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
        match columns::read(out) {
            Ok((figures, times)) => Self {
                figures,
                times,
                ..row
            },
            Err(error) => Self {
                outcome: DriveOutcome::Failed,
                sentence: error.to_string(),
                ..row
            },
        }
    }

    /// The row of a drive that nobody has computed yet.
    pub fn not_run(drive: &Drive, settings: &Settings, sentence: &str) -> Self {
        Self {
            sentence: sentence.to_owned(),
            ..Self::without_results(drive, settings, DriveOutcome::NotRun)
        }
    }

    fn without_results(drive: &Drive, settings: &Settings, outcome: DriveOutcome) -> Self {
        Self {
            version: VERSION,
            drive: drive.clone(),
            settings: settings.clone(),
            outcome,
            sentence: String::new(),
            figures: Values::new(),
            times: Values::new(),
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
        let text = serde_json::to_string_pretty(self).map_err(unknown(&path))?;
        Ok(gyre_storage::write(&path, text)?)
    }

    /// Reads that of a drive; `None`: there is none.
    ///
    /// # Errors
    /// A file that cannot be read, or that is none of this version.
    pub fn read(batch: &Path, drive: &Drive) -> Result<Option<Self>, BatchError> {
        let path = Self::path(batch, drive);
        let Some(text) = optional_text(&path)? else {
            return Ok(None);
        };
        let row: Self = serde_json::from_str(&text).map_err(unknown(&path))?;
        match row.version {
            VERSION => Ok(Some(row)),
            version => Err(unknown(&path)(format!("version {version}"))),
        }
    }

    /// Reads that of a drive with these settings whose results are there; `None`: there are none,
    /// or they are being computed anew.
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
        assert_eq!(DriveRow::read(batch.path(), &drive()).unwrap(), None);
        let mut row = DriveRow::not_run(&drive(), &Settings::default(), "not yet");
        row.figures.insert("ate_rmse_m".to_owned(), 0.0123.into());
        row.write(batch.path()).unwrap();
        assert_eq!(
            DriveRow::read(batch.path(), &drive()).unwrap().unwrap(),
            row
        );

        let path = DriveRow::path(batch.path(), &drive());
        let text = fs::read_to_string(&path).unwrap();
        fs::write(&path, &text[..text.len() / 2]).unwrap();
        let error = DriveRow::read(batch.path(), &drive())
            .unwrap_err()
            .to_string();
        assert!(error.contains("a.json is not what"), "{error}");
    }

    #[test]
    fn a_row_of_other_settings_is_not_that_of_the_drive() {
        let settings = Settings {
            set: vec!["slam.kind=graph".to_owned()],
            ..Settings::default()
        };
        let row = DriveRow::not_run(&drive(), &settings, "");
        assert!(row.is_of(&drive(), &settings));
        assert!(!row.is_of(&drive(), &Settings::default()));
    }

    #[test]
    fn a_complete_drive_without_its_results_is_a_failure() {
        let out = tempfile::tempdir().unwrap();
        let settings = Settings::default();
        let sentence = String::new();
        let row = DriveRow::of(
            &drive(),
            &settings,
            DriveOutcome::Complete,
            sentence,
            out.path(),
        );
        assert_eq!(row.outcome, DriveOutcome::Failed);
        assert!(row.sentence.contains("summary.json"), "{}", row.sentence);
    }
}
