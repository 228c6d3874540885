//! The end of a drive, and its row: `rows/NAME.json`. The rows are the table.

use std::{
    fmt,
    path::{Path, PathBuf},
};

use gyre_configuration::terminal::Failure;
use gyre_contract::run::COMPLETE;
use gyre_results::HARDLY_MEASURED;
use serde::{Deserialize, Serialize};
use serde_json::Value;

use crate::batch::{Drive, table};

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
    pub values: table::Values,
}

impl Row {
    /// The row of a drive that has ended in the folder of a batch.
    pub fn of(batch: &Path, drive: &Drive, outcome: Outcome, sentence: impl Into<String>) -> Self {
        let (values, problem) = match outcome {
            Outcome::Complete => match table::values(&Self::results(batch, drive)) {
                Ok(read) => read,
                Err(error) => return Self::of(batch, drive, Outcome::Failed, error),
            },
            _ => (table::Values::new(), None),
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
        let reason = match table::read_json::<Self>(&path) {
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
