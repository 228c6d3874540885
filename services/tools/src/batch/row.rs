//! The end of a drive, and its row: `rows/NAME.json`. The rows are the table.

use std::{
    fmt, io,
    path::{Path, PathBuf},
};

use gyre_run::COMPLETE;
use gyre_terminal::Failure;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::batch::{
    Drive,
    figures::{self, Values},
};

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

impl fmt::Display for Outcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        self.serialize(f)
    }
}

/// The end of a drive's process: the last line that it prints, as JSON.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct End {
    pub outcome: Outcome,
    /// True if the drive had ended so before.
    pub earlier: bool,
    /// True if the drive was not looked at: its earlier results still count.
    pub unchecked: bool,
    /// The reason why it is not complete; else empty.
    pub sentence: String,
}

impl End {
    pub fn of(outcome: Outcome, sentence: impl Into<String>) -> Self {
        Self {
            outcome,
            earlier: false,
            unchecked: false,
            sentence: sentence.into(),
        }
    }

    /// Returns the end of a drive whose recording or folder could not be looked at.
    pub fn unchecked(sentence: impl Into<String>) -> Self {
        Self {
            unchecked: true,
            ..Self::of(Outcome::Failed, sentence)
        }
    }

    pub fn interrupted() -> Self {
        let sentence = "the batch was interrupted: the same command continues";
        Self {
            outcome: Outcome::Interrupted,
            ..Self::unchecked(sentence)
        }
    }
}

/// The settings that the drives of a batch have in common.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Settings {
    /// The configuration of drives without a configuration, an absolute path; `None`: by their
    /// formats and scans.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub configuration: Option<PathBuf>,
    /// Overrides of each configuration, `section.key=value`. Overrides of a drive have precedence.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub set: Vec<String>,
}

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    pub drive: Drive,
    pub settings: Settings,
    pub outcome: Outcome,
    /// The reason why it is not complete, in a sentence; else empty.
    pub sentence: String,
    /// The values of both tables by column; empty unless all scans were played.
    pub values: Values,
}

impl Row {
    /// The row of a drive that has ended in the folder of a batch.
    pub fn of(
        batch: &Path,
        drive: &Drive,
        settings: &Settings,
        outcome: Outcome,
        sentence: impl Into<String>,
    ) -> Self {
        let mut row = Self {
            drive: drive.clone(),
            settings: settings.clone(),
            outcome,
            sentence: sentence.into(),
            values: Values::new(),
        };
        if outcome.has_results() {
            match figures::read(&Self::results(batch, drive)) {
                Ok(values) => row.values = values,
                Err(error) => (row.outcome, row.sentence) = (Outcome::Failed, error.to_string()),
            }
        }
        row
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
    pub fn read(batch: &Path, drive: &Drive, settings: &Settings) -> Result<Self, Failure> {
        let not_run = |sentence: &str| Self::of(batch, drive, settings, Outcome::NotRun, sentence);
        let path = Self::path(batch, drive);
        let text = match gyre_storage::read_text(&path, gyre_storage::SETTINGS) {
            Ok(text) => text,
            Err(error) if error.kind() == io::ErrorKind::NotFound => {
                return Ok(not_run("it has not been computed yet"));
            }
            Err(error) => return Err(format!("cannot read {}: {error}", path.display()).into()),
        };
        let row: Self = match serde_json::from_str(&text) {
            Ok(row) => row,
            Err(error) => return Ok(not_run(&figures::unknown(&path, error))),
        };
        if (&row.drive, &row.settings) != (drive, settings) {
            return Ok(not_run("it was computed with other settings"));
        }
        // A run that begins removes the results before it.
        let has_results = || Self::results(batch, drive).join(COMPLETE).exists();
        Ok(match row.outcome.has_results() && !has_results() {
            true => not_run("its results are being computed again, or were removed"),
            false => row,
        })
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
