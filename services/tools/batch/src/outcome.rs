//! The outcomes of a drive.

use std::fmt;

use gyre_stage::run::SHARED_MEMORY;
use rustix::io::Errno;
use serde::{Deserialize, Serialize};

/// The exit codes of a drive's process begin here, one for each outcome.
const CODES: u8 = 40;
/// Added to the exit code of a drive that was complete before.
const EARLIER: u8 = 20;

/// Defines the outcomes with their names in the table.
macro_rules! outcomes {
    ($($(#[doc = $doc:literal])+ $outcome:ident: $name:literal,)+) => {
        /// The outcome of a drive: the column `outcome` of the table.
        #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
        pub enum DriveOutcome {
            $(
                $(#[doc = $doc])+
                #[serde(rename = $name)]
                $outcome,
            )+
        }

        impl DriveOutcome {
            /// All of them, in the order in which they are reported.
            pub const ALL: [Self; [$($name,)+].len()] = [$(Self::$outcome,)+];

            /// Returns the name in the table.
            pub fn name(self) -> &'static str {
                match self {
                    $(Self::$outcome => $name,)+
                }
            }
        }
    };
}

outcomes! {
    /// All scans have been played, and all results are there.
    Complete: "complete",
    /// All scans have been played, but too many of them cannot be read.
    Corrupt: "corrupt",
    /// All scans have been played, but too many of the motions are weak or predicted.
    Unsure: "unsure",
    /// There is nothing at its path.
    Missing: "missing",
    /// The path leads to no recording, or to one with too few scans or an unreadable first one.
    NotADataset: "not-a-dataset",
    /// The configuration was refused.
    Configuration: "configuration",
    /// The computer lacks something: shared memory, open files.
    Machine: "machine",
    /// The disk of the results is full.
    DiskFull: "disk-full",
    /// Another process is writing to its results.
    InUse: "in-use",
    /// The run could not begin, or has failed: a stage died or hung more often than it may, for
    /// instance. The sentence has the reason.
    Failed: "failed",
    /// The process of its supervisor was killed.
    Killed: "killed",
    /// The batch was interrupted.
    Interrupted: "interrupted",
    /// It has not been computed yet, or with other settings.
    NotRun: "not-run",
}

impl DriveOutcome {
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
        if sentence.contains(&format!("{SHARED_MEMORY} is full")) {
            return Some(Self::Machine);
        }
        // Results may lie there too.
        let is_memory = sentence.contains("shared memory")
            || sentence.contains(&format!("{SHARED_MEMORY}/gyre-"));
        is_full.then_some(match is_memory {
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

    /// Returns the exit code of the drive's process; `earlier`: it had ended so before.
    pub fn exit_code(self, earlier: bool) -> u8 {
        CODES + self as u8 + if earlier { EARLIER } else { 0 }
    }

    /// Returns the outcome of an exit code, and whether it had ended so before. Any other code is
    /// that of a process which has failed.
    pub(crate) fn of_exit_code(code: i32) -> (Self, bool) {
        let has_code = |earlier| {
            let mut all = Self::ALL.into_iter();
            let found = all.find(|outcome| i32::from(outcome.exit_code(earlier)) == code);
            found.map(|outcome| (outcome, earlier))
        };
        has_code(false)
            .or_else(|| has_code(true))
            .unwrap_or((Self::Failed, false))
    }
}

impl fmt::Display for DriveOutcome {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn each_outcome_has_its_exit_codes_and_no_other_program_has_them() {
        for outcome in DriveOutcome::ALL {
            for earlier in [false, true] {
                let code = i32::from(outcome.exit_code(earlier));
                assert_eq!(DriveOutcome::of_exit_code(code), (outcome, earlier));
                // Success, failure, wrong arguments, a panic, and what shells and interrupts give.
                assert!(![0, 1, 2, 101].contains(&code) && code < 126, "{code}");
            }
        }
        for code in [1, 2, 101] {
            assert_eq!(
                DriveOutcome::of_exit_code(code),
                (DriveOutcome::Failed, false)
            );
        }
    }

    #[test]
    fn a_full_disk_is_not_full_shared_memory() {
        let sentence = |of: &str| format!("{of}: No space left on device (os error 28)");
        let disk = Some(DriveOutcome::DiskFull);
        let memory = Some(DriveOutcome::Machine);
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
            assert_eq!(DriveOutcome::of_full(&sentence(of)), outcome, "{of}");
        }
        let transport = "cannot open topic `scan`: InternalFailure; /dev/shm is full";
        assert_eq!(DriveOutcome::of_full(transport), memory);
        let quota = "cannot write a: Disk quota exceeded (os error 122)";
        assert_eq!(DriveOutcome::of_full(quota), disk);
        let other = "cannot write a: Read-only file system (os error 30)";
        assert_eq!(DriveOutcome::of_full(other), None);
    }

    #[test]
    fn names_are_those_in_files() {
        for outcome in DriveOutcome::ALL {
            let written = serde_json::to_string(&outcome).unwrap_or_default();
            assert_eq!(written, format!("\"{outcome}\""));
        }
    }
}
