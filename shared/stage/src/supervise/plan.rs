//! What the supervisor is asked for, what it tells meanwhile, and what it says at the end.

use std::{collections::BTreeMap, time::Duration};

use gyre_messages::PoseHeader;
use serde::{Deserialize, Serialize};
use thiserror::Error;

use super::child::Death;
use crate::{Manifest, StageCounters, StageError};

/// A run.
#[derive(Debug)]
pub struct Plan {
    /// What all its processes must know.
    pub manifest: Manifest,
    /// Its processes, in the order of the stream.
    pub stages: Vec<StagePlan>,
    /// Start everybody again when no pose has come for so long; `None`: wait for ever.
    pub stall_timeout: Option<Duration>,
}

/// One process of a run.
#[derive(Clone, Debug)]
pub struct StagePlan {
    /// Its name: a stage's, or any other for a process beside them.
    pub name: String,
    /// Program and arguments; run as they are, never through a shell.
    pub command: Vec<String>,
    /// What to do when it dies.
    pub restart: RestartPolicy,
    /// It goes on when the others are restarted: a live source, since a radar does not wait.
    pub outlives_restarts: bool,
    /// Its death restarts the others too: it owns state that a restart alone does not bring back.
    pub restarts_all: bool,
}

/// When to give up on a stage: after `limit` restarts within `window_s`.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RestartPolicy {
    /// Maximum number of restarts within `window_s`; one more ends the run.
    pub limit: usize,
    /// Length of the time window of `limit`, s.
    pub window_s: f64,
    /// Delay before the restart of a stage that ended by itself, ms. A killed one is restarted at once.
    pub backoff_ms: u64,
}

impl Default for RestartPolicy {
    fn default() -> Self {
        Self {
            limit: 5,
            window_s: 30.0,
            backoff_ms: 100,
        }
    }
}

/// What happens while a run goes on.
#[derive(Debug)]
pub enum Event<'a> {
    /// A process was started for the first time.
    Started {
        /// Which.
        stage: &'a str,
        /// Its process id.
        pid: u32,
    },
    /// A new pose.
    Pose(&'a PoseHeader),
    /// A process has died.
    Died {
        /// Which.
        stage: &'a str,
        /// How.
        death: &'a Death,
    },
    /// The dead, or everybody, were started again.
    Restarted {
        /// Whether all were.
        everybody: bool,
    },
    /// No pose for too long: everybody is about to be started again.
    Stalled,
}

/// How a run ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Ending {
    /// All scans are in the trajectory.
    Complete,
    /// SIGINT or SIGTERM.
    Interrupted,
}

/// What the supervisor knows at the end.
#[derive(Debug)]
pub struct Report {
    /// How it ended.
    pub ending: Ending,
    /// Restarts by stage.
    pub restarts: BTreeMap<String, usize>,
    /// From each death to the first pose that the new process worked on.
    pub recovery: Vec<Duration>,
    /// What each stage counted in its last life.
    pub counters: BTreeMap<String, StageCounters>,
}

/// Why a run could not go on.
#[derive(Debug, Error)]
pub enum SuperviseError {
    /// The supervisor's own part in the transport.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// A command cannot be started.
    #[error(
        "cannot start {stage} with `{command}`: {source}; see [stages.{stage}] command in the configuration"
    )]
    Spawn {
        /// Which stage.
        stage: String,
        /// Its command.
        command: String,
        /// What the operating system said.
        source: std::io::Error,
    },
    /// A stage that would fail the same way again.
    #[error("{words}")]
    Hopeless {
        /// What it said.
        words: String,
    },
    /// A stage that dies again and again.
    #[error(
        "{stage} died {times} times within {window_s} s, the last time by {how}{words}; giving up"
    )]
    TooManyDeaths {
        /// Which.
        stage: String,
        /// How often.
        times: usize,
        /// Within how long.
        window_s: f64,
        /// How it died last.
        how: String,
        /// What it said last.
        words: String,
    },
    /// Nothing comes out, though nobody dies.
    #[error(
        "no pose for {after:?}, three times in a row, though no stage died; see log.jsonl for what they wait for"
    )]
    Stalled {
        /// The limit.
        after: Duration,
    },
    /// The transport's own cleaning hangs: only a fresh start under new names helps.
    #[error("the transport does not finish cleaning up after a dead process")]
    TransportStuck,
}
