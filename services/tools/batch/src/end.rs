//! The end of a drive's process.

use std::fmt;

use gyre_stage::run::SHARED_MEMORY;
use rustix::io::Errno;
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
    /// There is nothing at its path.
    Missing,
    /// The path leads to no recording, or to one with too few scans or an unreadable first one.
    #[serde(rename = "not-a-dataset")]
    NotADataset,
    /// The configuration was refused.
    Configuration,
    /// The computer lacks something: shared memory, open files.
    Machine,
    /// The disk of the results is full.
    DiskFull,
    /// Another process is writing to its results.
    InUse,
    /// The run could not begin, or has failed, for instance since a stage died too often.
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

    /// Returns the outcome of a failure, by its sentence, if a disk, a quota or shared memory is
    /// full. The last words of a stage are a text, as the system's errors are written in Rust.
    pub fn of_full(sentence: &str) -> Option<Self> {
        let is_full = [Errno::NOSPC, Errno::DQUOT].iter().any(|error| {
            let error = format!("(os error {})", error.raw_os_error());
            sentence.contains(&error)
        });
        // The transport names no error of the system.
        let is_transport = sentence.contains(&format!("{SHARED_MEMORY} is full"));
        // Results may be in that folder too.
        let is_memory = is_transport
            || sentence.contains("shared memory")
            || sentence.contains(&format!("{SHARED_MEMORY}/gyre-"));
        (is_full || is_transport).then_some(match is_memory {
            true => Self::Machine,
            false => Self::DiskFull,
        })
    }

    /// Returns whether a drive that ends so still has the results that it had: it was not begun.
    pub(crate) fn leaves_results(self) -> bool {
        matches!(
            self,
            Self::Missing | Self::Machine | Self::InUse | Self::Interrupted
        )
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
    /// The outcome.
    pub outcome: Outcome,
    /// True if the drive had ended so before.
    pub earlier: bool,
    /// The reason why it is not complete; else empty.
    pub sentence: String,
}

impl End {
    /// Returns an end now.
    pub fn of(outcome: Outcome, sentence: impl Into<String>) -> Self {
        Self {
            outcome,
            earlier: false,
            sentence: sentence.into(),
        }
    }

    /// Returns the end of a drive that was interrupted.
    pub fn interrupted() -> Self {
        let sentence = "the batch was interrupted: the same command continues";
        Self::of(Outcome::Interrupted, sentence)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_full_disk_is_not_full_shared_memory() {
        let sentence = |of: &str| format!("{of}: No space left on device (os error 28)");
        let disk = Some(Outcome::DiskFull);
        let memory = Some(Outcome::Machine);
        for (of, outcome) in [
            ("cannot write drives/a/summary.json", disk),
            ("cannot write /dev/shm/out/drives/a/summary.json", disk),
            ("shared memory at /dev/shm has no room for 1 MB", memory),
            (
                "cannot use /dev/shm/gyre-0 for the run's shared memory",
                memory,
            ),
            ("/dev/shm/gyre-0/gyre0123456789/services", memory),
        ] {
            assert_eq!(Outcome::of_full(&sentence(of)), outcome, "{of}");
        }
        let transport = "cannot open topic `scan`: InternalFailure; /dev/shm is full";
        assert_eq!(Outcome::of_full(transport), memory);
        let quota = "cannot write a: Disk quota exceeded (os error 122)";
        assert_eq!(Outcome::of_full(quota), disk);
        let other = "cannot write a: Read-only file system (os error 30)";
        assert_eq!(Outcome::of_full(other), None);
    }

    #[test]
    fn names_are_those_in_files() {
        assert_eq!(Outcome::NotADataset.to_string(), "not-a-dataset");
        assert_eq!(Outcome::DiskFull.to_string(), "disk-full");
    }
}
