//! The supervisor's plan, events and errors.

use std::{
    path::{Path, PathBuf},
    time::Duration,
};

use gyre_contract::{
    FollowerId, PoseHeader, StageId,
    run::{RestartPolicy, Scheduling},
};
use gyre_stage::follower::Progress;
use gyre_transport::{Manifest, RunError};
use thiserror::Error;

use crate::program::Program;

#[derive(Debug)]
pub struct Plan {
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
    /// True if the processes that apply commands are here: masking and pose-integration.
    pub takes_commands: bool,
}

/// The roles of the processes, which are indices into [`Plan::stages`]: which of them a restart
/// concerns. A swap does not change them.
impl Plan {
    pub(crate) fn name(&self, process: usize) -> &str {
        &self.stages[process].name
    }

    pub(crate) fn follows(&self, process: usize) -> bool {
        FollowerId::by_name(self.name(process)).is_some()
    }

    pub(crate) fn named(&self, name: &str) -> Option<usize> {
        self.stages.iter().position(|plan| plan.name == name)
    }

    pub(crate) fn names(&self) -> impl Iterator<Item = &str> {
        self.stages.iter().map(|plan| plan.name.as_str())
    }

    pub(crate) fn in_stream(&self) -> impl Iterator<Item = usize> {
        (0..self.stages.len()).filter(move |process| !self.follows(*process))
    }

    pub(crate) fn followers(&self) -> impl Iterator<Item = usize> {
        (0..self.stages.len()).filter(move |process| self.follows(*process))
    }

    pub(crate) fn sources(&self) -> Vec<usize> {
        let is_source = |name| StageId::by_name(name) == Some(StageId::RadarReplay);
        let all = 0..self.stages.len();
        all.filter(|process| is_source(self.name(*process)))
            .collect()
    }

    /// Returns all stages except those that are alive and outlive restarts.
    pub(crate) fn all_but_survivors(&self, dead: &[usize]) -> Vec<usize> {
        let survives = |i: &usize| self.stages[*i].outlives_restarts && !dead.contains(i);
        self.in_stream().filter(|i| !survives(i)).collect()
    }

    /// Returns whether the restart of a process alone does not recover its state.
    pub(crate) fn restarts_all(&self, process: usize) -> bool {
        self.stages[process].restarts_all
    }

    pub(crate) fn restarted_with(&self, process: usize) -> Vec<usize> {
        match self.restarts_all(process) {
            true => self.all_but_survivors(&[process]),
            false => vec![process],
        }
    }
}

#[derive(Clone, Debug)]
pub struct StagePlan {
    /// The name of the stage, or any other for an additional process.
    pub name: String,
    pub command: Vec<String>,
    /// The files that the command executes. After a change of one of them the stage is not started
    /// again.
    pub programs: Vec<Program>,
    /// The directory for starting it; `None`: the supervisor's.
    pub directory: Option<PathBuf>,
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
    /// A process that is restarted alone, with the usual policy.
    pub fn new(name: &str, command: Vec<String>) -> Self {
        Self {
            name: name.to_owned(),
            command,
            programs: Vec::new(),
            directory: None,
            scheduling: Scheduling::default(),
            restart: RestartPolicy::default(),
            outlives_restarts: false,
            restarts_all: false,
            end_timeout: END_TIMEOUT,
        }
    }

    /// Returns a file of the command that has changed since this plan was made.
    pub(crate) fn changed_file(&self) -> Option<&Path> {
        let changed = self.programs.iter().find(|program| !program.is_unchanged());
        changed.map(Program::path)
    }
}

#[derive(Debug)]
pub enum Event<'a> {
    Pose(&'a PoseHeader),
    /// A sentence for the person at the terminal.
    Note(&'a str),
    /// The run makes no progress: the stages that may be the cause are about to be restarted.
    Stalled(&'a Stall),
    /// The stream has ended, and a follower has not come to the end of its logs.
    Following {
        follower: &'a str,
        progress: Progress,
    },
    /// All stages have opened their topics, for the first time.
    Ready,
    /// The supervisor has looked at all processes, which it does every 200 ms or more often.
    Watched,
    Stopping,
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
    Follower { follower: String, limit: Duration },
    #[error(
        "{process} hangs: it has not come to its next wait for {limit:?} (run.stall_timeout_s)"
    )]
    Hang { process: String, limit: Duration },
    #[error("{stage} has not opened its topics within {limit:?} (run.start_timeout_s)")]
    Start { stage: String, limit: Duration },
}

#[derive(Debug, Error)]
pub enum SuperviseError {
    #[error(transparent)]
    Stage(#[from] RunError),
    /// One process cannot be kept alive.
    #[error("{0}")]
    Process(String),
    /// The system refuses a thing that the supervisor itself needs.
    #[error("{0}")]
    System(String),
    #[error(
        "{0}, three times in a row, although no stage died; log.jsonl and log/ show what the stages wait for"
    )]
    Stalled(Stall),
    /// The transport's cleanup hangs; only a new run under new names helps.
    #[error("the transport does not finish cleaning up after a dead process")]
    TransportStuck,
}
