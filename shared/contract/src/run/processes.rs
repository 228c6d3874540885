//! The sections that are about the processes of a run.

use std::path::{Path, PathBuf};

use serde::{Deserialize, Serialize};

use crate::run::{Rate, Scheduling};

/// The section `[run]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RunConfig {
    /// `lossless`: every scan is processed, and the source waits. `live`: the newest scan wins.
    pub mode: Mode,
    /// The treatment of a run in the folder of the results that this one cannot continue, as one of
    /// another program or configuration. `close`: it has its results, the time of its begin follows
    /// the name of its folder, and this run begins. `refuse`: this run does not begin. `auto`:
    /// `close` in live mode, else `refuse`.
    pub earlier: EarlierRun,
    /// Maximum number of scans between admission and their pose, 1 to 64. More than the free cores
    /// increases latency and not throughput.
    pub window: usize,
    /// Pace of the source: `max`, `realtime`, or a factor of real time from 0.001 to 1000. Live
    /// mode needs another than `max`.
    pub rate: Rate,
    /// Poses between the scans of a live radar, on the topic `predicted_pose`: number per second,
    /// at most 200. 0: none.
    pub predict_hz: f64,
    /// Room for programs that look on, 0 to 64 of each topic: `gyre watch`, a viewer, a recorder.
    /// They change neither a result nor a latency. Each needs shared memory for one message of each
    /// topic.
    pub observers: usize,
    /// Time for which a published scan may lack its pose, or the source a scan that is due, s; 0:
    /// no limit. Then stages are restarted: first the source if it is late, else all but a live
    /// source; if that does not help, all; if that does not help either, the run ends. With SLAM it
    /// is also the time limit for progress of a follower at the end of the run; a follower without
    /// progress is restarted.
    pub stall_timeout_s: f64,
    /// Time for a stage to open its topics after its start, s; 0: no limit. A stage that takes
    /// longer, as one that cannot load its model, is treated as a stall.
    pub start_timeout_s: f64,
    /// The scheduling of the stages: priority, processors, memory. Followers have their own alone.
    #[serde(skip_serializing_if = "crate::run::unset::is_default")]
    pub scheduling: Scheduling,
    /// Longest time that a processor may take to wake from idleness, us; 0: none sleeps, which
    /// costs power. For the whole machine, while the run lives. It needs the right to write to
    /// `/dev/cpu_dma_latency`. Default: as the system has it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub cpu_wake_us: Option<u32>,
    /// Ground truth for the evaluation. Default: the one in the recording's folder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ground_truth: Option<PathBuf>,
}

/// The policy when scans arrive faster than they can be processed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum Mode {
    /// The source waits.
    Lossless,
    /// The newest scan wins.
    Live,
}

/// The treatment of an earlier run: see [`RunConfig::earlier`].
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum EarlierRun {
    /// As the mode is.
    #[default]
    Auto,
    /// This run does not begin.
    Refuse,
    /// It is kept under another name.
    Close,
}

/// A section `[stages.NAME]`.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct StageConfig {
    /// Program and arguments of a replacement. Default: `gyre stage NAME`.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub command: Vec<String>,
    /// File of Python with the function that does the work, in the place of a command: `mask` for
    /// `masking`, `rotation` for `rotation-search`, `translation` for `translation-search`. A mask
    /// replaces the network of `[masking]`. See docs/replace-a-stage.md.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub python: Option<PathBuf>,
    /// Limits of its restarts.
    pub restart: RestartPolicy,
    /// The scheduling of the process: its keys override `run.scheduling`.
    #[serde(skip_serializing_if = "crate::run::unset::is_default")]
    pub scheduling: Scheduling,
    /// Delay for each scan, ms, to test behaviour under load. Source and `pose-integration` have
    /// none.
    #[serde(skip_serializing_if = "crate::run::unset::is_default")]
    #[schemars(skip)]
    pub delay_ms: u64,
}

impl StageConfig {
    /// The processes that can be a function of Python, each with the name of the function.
    pub const PYTHON: [(&'static str, &'static str); 3] = [
        ("masking", "mask"),
        ("rotation-search", "rotation"),
        ("translation-search", "translation"),
    ];

    /// Returns the function of Python that a process can be.
    pub fn function(process: &str) -> Result<&'static str, String> {
        let found = Self::PYTHON.iter().find(|(name, _)| *name == process);
        found.map(|(_, function)| *function).ok_or_else(|| {
            let names = Self::PYTHON.map(|(name, _)| name).join(", ");
            format!("of all processes {names} can be a function of Python")
        })
    }

    /// Returns the command of a process: its replacement, or `gyre stage NAME`.
    pub fn command(&self, gyre: &str, name: &str) -> Vec<String> {
        match self.command.is_empty() {
            true => Self::own_command(gyre, name, self.python.as_deref()),
            false => self.command.clone(),
        }
    }

    /// Returns the program that takes the place of Gyre's own process, with its arguments, or the
    /// file of the function of Python; empty without any.
    pub fn replacement(&self) -> Vec<String> {
        let python = self.python.iter().map(|file| file.to_string_lossy());
        let python = python.map(|file| file.into_owned());
        self.command.iter().cloned().chain(python).collect()
    }

    /// Returns the command of Gyre's own process, with a function of Python if one is given.
    pub fn own_command(gyre: &str, name: &str, python: Option<&Path>) -> Vec<String> {
        let mut command = [gyre, "stage", name].map(str::to_owned).to_vec();
        if let Some(file) = python {
            command.extend(["--python".to_owned(), file.to_string_lossy().into_owned()]);
        }
        command
    }
}

/// When to give up on a stage.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RestartPolicy {
    /// Maximum number of restarts within 30 s; one more ends the run.
    pub limit: usize,
}

impl Default for RestartPolicy {
    fn default() -> Self {
        Self { limit: 5 }
    }
}

impl Default for RunConfig {
    fn default() -> Self {
        Self {
            mode: Mode::Lossless,
            earlier: EarlierRun::Auto,
            window: 4,
            rate: Rate::Max,
            predict_hz: 0.0,
            observers: 8,
            stall_timeout_s: 60.0,
            start_timeout_s: 300.0,
            scheduling: Scheduling::default(),
            cpu_wake_us: None,
            ground_truth: None,
        }
    }
}
