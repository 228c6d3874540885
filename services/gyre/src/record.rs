//! `gyre record`: records a running run, from outside or as a process of it.

use std::{
    path::{Path, PathBuf},
    process::ExitCode,
};

use gyre_recorder::Options;
use gyre_stage::supervise::{RestartPolicy, Scheduling, StagePlan};
use serde::{Deserialize, Serialize};

use crate::{Failure, cli::RecordArguments, print};

/// The section `[record]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RecordConfig {
    /// The file to which the run is recorded, `NAME.mcap`; `--record` on the command line. Default: none.
    #[serde(skip_serializing_if = "is_empty")]
    pub file: PathBuf,
    /// What is recorded: `scan`, `masked`, `rotation`, `motion`, `refined`, `pose`, `loop`, `correction`, `fix`, `log`. Default: what
    /// the run has of these but `masked` and `rotation`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub topics: Vec<String>,
    /// Limits of the recorder's restarts.
    pub restart: RestartPolicy,
}

fn is_empty(path: &Path) -> bool {
    path.as_os_str().is_empty()
}

impl RecordConfig {
    /// Returns whether the run is recorded.
    pub fn is_on(&self) -> bool {
        !is_empty(&self.file)
    }

    /// Returns the process that records the run that writes to `out`.
    pub fn plan(&self, gyre: &Path, out: &Path) -> Option<StagePlan> {
        if !self.is_on() {
            return None;
        }
        let text = |path: &Path| path.to_string_lossy().into_owned();
        let mut command = vec![text(gyre), "record".to_owned(), text(out)];
        command.extend([
            "--continues".to_owned(),
            "--to".to_owned(),
            text(&self.file),
        ]);
        if !self.topics.is_empty() {
            command.extend(["--topics".to_owned(), self.topics.join(",")]);
        }
        Some(StagePlan {
            name: "recorder".to_owned(),
            command,
            programs: Vec::new(),
            directory: None,
            scheduling: Scheduling::default(),
            restart: self.restart,
            outlives_restarts: true,
            restarts_all: false,
        })
    }

    /// Checks that a run that begins writes over no recording.
    ///
    /// # Errors
    /// There is one.
    pub fn require_new(&self) -> Result<(), Failure> {
        match self.is_on() && self.file.exists() {
            true => Err(gyre_recorder::RecorderError::Exists(self.file.clone()).into()),
            false => Ok(()),
        }
    }
}

/// Records a run until it ends or an interrupt, and says what was recorded and what was missed.
///
/// # Errors
/// There is no such run or topic.
pub fn record(arguments: &RecordArguments) -> ExitCode {
    let options = Options {
        out: arguments.out.clone(),
        to: arguments.to.clone(),
        topics: arguments.topics.clone(),
        continues: arguments.continues,
    };
    match gyre_recorder::record(&options) {
        Ok(recorded) => {
            print::note(&recorded);
            // To the run it is no failure, and no reason for a restart.
            match recorded.is_complete() || arguments.continues {
                true => ExitCode::SUCCESS,
                false => ExitCode::FAILURE,
            }
        }
        Err(error) => {
            print::note(format_args!("gyre record: {error}"));
            ExitCode::from(error.exit_code())
        }
    }
}
