//! The end of a drive's process.

use std::fmt;

use serde::{Deserialize, Serialize};

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
    /// The process of its supervisor was killed.
    Killed,
    /// The batch was interrupted.
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
    /// Returns an end now.
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

    /// Returns the end of a drive that was interrupted.
    pub fn interrupted() -> Self {
        let sentence = "the batch was interrupted: the same command continues";
        Self {
            outcome: Outcome::Interrupted,
            ..Self::unchecked(sentence)
        }
    }
}
