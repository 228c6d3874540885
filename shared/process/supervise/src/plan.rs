//! The supervisor's plan, events and errors.

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use gyre_messages::PoseHeader;
use gyre_run::{RestartPolicy, Scheduling};
use gyre_stage::{Manifest, StageError, follower::Progress};
use thiserror::Error;

use crate::{death::Death, program::Program};

/// The plan of a run.
#[derive(Debug)]
pub struct Plan {
    /// The manifest, which all processes read.
    pub manifest: Manifest,
    /// The processes: the stages in the order of the stream, then the followers.
    pub stages: Vec<StagePlan>,
    /// The process that records the run, if any: nothing depends on it.
    pub recorder: Option<StagePlan>,
    /// Program and arguments of a process that calls [`guard`](crate::guard) with its standard
    /// input.
    pub guardian: Vec<String>,
    /// Time for which a published scan may lack its pose, or the source a scan that is due; `None`:
    /// no limit.
    pub stall_timeout: Option<Duration>,
    /// Time for a stage to open its topics; `None`: no limit.
    pub start_timeout: Option<Duration>,
    /// Longest time that a processor of the machine may take to wake while the run lives, us;
    /// `None`: as the system has it.
    pub cpu_wake_us: Option<u32>,
}

/// One process of a run.
#[derive(Clone, Debug)]
pub struct StagePlan {
    /// The name of the stage, or any other for an additional process.
    pub name: String,
    /// Program and arguments, executed without a shell.
    pub command: Vec<String>,
    /// The files that the command executes. After a change of one of them the stage is not started
    /// again.
    pub programs: Vec<Program>,
    /// The directory for starting it; `None`: the supervisor's.
    pub directory: Option<PathBuf>,
    /// The scheduling of the process.
    pub scheduling: Scheduling,
    pub restart: RestartPolicy,
    /// True if it keeps running when the others are restarted: a live source, since a radar does
    /// not wait.
    pub outlives_restarts: bool,
    /// True if its death restarts the others too: it has state that its own restart does not
    /// recover.
    pub restarts_all: bool,
    /// Time for it to end unasked when the run is complete, unless a stop is requested.
    pub end_timeout: Duration,
}

/// Time for a process to end before it is killed.
pub const END_TIMEOUT: Duration = Duration::from_secs(2);

impl StagePlan {
    /// Returns a file of the command that has changed since this plan was made.
    pub(crate) fn changed_file(&self) -> Option<&Path> {
        let changed = self.programs.iter().find(|program| !program.is_unchanged());
        changed.map(Program::path)
    }
}

/// An event during a run.
#[derive(Debug)]
pub enum Event<'a> {
    /// A process was started for the first time.
    Started {
        /// The name of the stage.
        stage: &'a str,
        pid: u32,
    },
    Pose(&'a PoseHeader),
    Died {
        /// The name of the stage.
        stage: &'a str,
        death: &'a Death,
    },
    Restarted {
        /// The only one, by its name; `None` if they are several: all stages, or all but a live
        /// source.
        only: Option<&'a str>,
    },
    /// The stream has ended, and a follower has not come to the end of its logs.
    Following {
        /// The name of the follower.
        follower: &'a str,
        progress: Progress,
    },
    /// A follower is not restarted any more. Odometry continues, and then the run ends with this
    /// error.
    GaveUp {
        /// The name of the follower.
        follower: &'a str,
        error: &'a SuperviseError,
    },
    /// The end of the recording, or a notice of a stage about the run.
    Note {
        sentence: &'a str,
    },
    /// The run makes no progress: the stages that may be the cause are about to be restarted.
    Stalled(&'a Stall),
    /// All stages have opened their topics, for the first time.
    Ready,
    /// The supervisor has looked at all processes, which it does every 200 ms or more often.
    Watched,
    /// The stages are asked to end.
    Stopping,
    /// Another program has taken the place of a stage.
    Swapped {
        /// The name of the stage.
        stage: &'a str,
        /// The program and its arguments.
        command: &'a [String],
    },
    /// The program that had taken the place of a stage has failed: the one before it is started
    /// again.
    WentBack {
        /// The name of the stage.
        stage: &'a str,
        reason: &'a str,
    },
}

/// A run that makes no progress, although no process has died.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Stall {
    #[error("no pose for {limit:?}")]
    Pose { limit: Duration },
    /// The source has not published a scan that is due, and all others have their poses.
    #[error("no scan from the source for {limit:?}, although one is due")]
    Scan { limit: Duration },
    /// The stream has ended, and a follower stays where it is in its logs.
    #[error("{follower} has made no progress for {limit:?} (run.stall_timeout_s)")]
    Follower {
        /// The name of the follower.
        follower: String,
        limit: Duration,
    },
    #[error(
        "{process} hangs: it has not come to its next wait for {limit:?} (run.stall_timeout_s)"
    )]
    Hang {
        /// The name of the stage or follower.
        process: String,
        limit: Duration,
    },
    #[error("{stage} has not opened its topics within {limit:?} (run.start_timeout_s)")]
    Start {
        /// The name of the stage.
        stage: String,
        limit: Duration,
    },
}

/// An error that ends a run.
#[derive(Debug, Error)]
pub enum SuperviseError {
    #[error(transparent)]
    Stage(#[from] StageError),
    #[error(
        "cannot start {stage} with `{command}`: {source}; see [stages.{stage}] command in the configuration"
    )]
    Spawn {
        /// The name of the stage.
        stage: String,
        command: String,
        source: std::io::Error,
    },
    #[error(
        "cannot run {stage} with {what}: {source}; see scheduling in [run] and [stages.{stage}] of the configuration"
    )]
    Scheduling {
        /// The name of the stage.
        stage: String,
        /// The key and its value.
        what: String,
        source: std::io::Error,
    },
    #[error(
        "cannot limit the time in which processors wake to {us} us (run.cpu_wake_us): /dev/cpu_dma_latency: {source}; give the user \
         of the run the right to write to it, or leave the key out"
    )]
    WakeLimit {
        /// The limit, us.
        us: u32,
        source: std::io::Error,
    },
    #[error(
        "cannot start `{command}`, which ends what the stages have started if the supervisor is killed: {source}"
    )]
    Guardian {
        command: String,
        source: std::io::Error,
    },
    #[error(
        "{stage} (process {pid}) does not end although it was killed: the kernel holds it, as it does while a disk or a network \
         folder does not answer"
    )]
    Undying {
        /// The name of the stage.
        stage: String,
        pid: u32,
    },
    #[error(
        "{stage} has ended, and {path} has changed since it was started: another program may compute other motions; put back the one that the run was begun with"
    )]
    Replaced {
        /// The name of the stage.
        stage: String,
        path: PathBuf,
    },
    /// A stage failed in a way that a restart would repeat.
    #[error("{message}")]
    Permanent {
        /// The stage's own error message.
        message: String,
    },
    #[error(
        "{stage} died {times} times within {window_s} s, the last time by {cause}{output}; giving up"
    )]
    TooManyDeaths {
        /// The name of the stage.
        stage: String,
        times: usize,
        /// The window for counting them, s.
        window_s: f64,
        /// The cause of the last death.
        cause: String,
        /// The last line of output, in parentheses.
        output: String,
    },
    #[error(
        "{0}, three times in a row, although no stage died; log.jsonl and log/ show what the stages wait for"
    )]
    Stalled(Stall),
    /// The transport's cleanup hangs; only a new run under new names helps.
    #[error("the transport does not finish cleaning up after a dead process")]
    TransportStuck,
}

impl SuperviseError {
    /// Returns whether it means that one process cannot be kept alive.
    pub(crate) fn is_of_one_process(&self) -> bool {
        matches!(
            self,
            Self::Spawn { .. }
                | Self::Scheduling { .. }
                | Self::Replaced { .. }
                | Self::Permanent { .. }
                | Self::TooManyDeaths { .. }
        )
    }
}
