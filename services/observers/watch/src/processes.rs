//! The processes of the run: what the supervisor says of them, and what the kernel counts.

use std::{collections::BTreeMap, path::Path, time::Instant};

use gyre_stage::{
    control::{Activity, Control, Status},
    source::Received,
    usage::Usage,
};
use serde::Serialize;

/// The name of the supervisor among the processes.
const SUPERVISOR: &str = "supervisor";

/// Reads the state of a run again and again.
#[derive(Debug, Default)]
pub struct ProcessMeter {
    /// The last usage of each process, and its time.
    before: BTreeMap<u32, (Instant, Usage)>,
}

/// A process of the run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Process {
    /// The name of the stage or follower.
    pub name: String,
    /// The process.
    pub pid: u32,
    /// What it does.
    pub state: &'static str,
    /// How good that is: `good`, `warn`, or `bad`.
    pub level: &'static str,
    /// Its restarts.
    pub restarts: usize,
    /// The cause of its last death.
    pub last_death: Option<String>,
    /// What a live radar has delivered, and what is missing; `None` if it is no source of one.
    pub received: Option<Received>,
    /// Share of one processor since the last look; `None` at the first.
    pub processor_share: Option<f64>,
    /// Processor time since its start, s, and memory of its own, bytes; `None` if it has just ended.
    pub cpu_s: Option<f64>,
    /// See above.
    pub own_bytes: Option<u64>,
}

impl ProcessMeter {
    /// Returns what the supervisor says of the run that writes to `out`, and its processes. `None` if there is no answer: the run
    /// is about to end, or its supervisor is stopped.
    pub fn look(&mut self, out: &Path) -> Option<(Status, Vec<Process>)> {
        let status = Control::of(out).and_then(|control| control.status()).ok()?;
        let supervisor = (SUPERVISOR, status.pid, "running", "good", 0, None, None);
        let others = status.processes.iter().map(|process| {
            let (name, activity) = (process.name.as_str(), process.activity);
            let death = process.last_death.clone();
            (
                name,
                process.pid,
                activity.name(),
                level(activity),
                process.restarts,
                death,
                process.received,
            )
        });
        let now = Instant::now();
        let mut after = BTreeMap::new();
        let processes = [supervisor].into_iter().chain(others).map(
            |(name, pid, state, level, restarts, last_death, received)| {
                let usage = Usage::of(pid);
                let before = self.before.get(&pid);
                let share = usage.zip(before).map(|(usage, (at, before))| {
                    usage.processor_share(before, now.duration_since(*at))
                });
                after.extend(usage.map(|usage| (pid, (now, usage))));
                Process {
                    name: name.to_owned(),
                    pid,
                    state,
                    level,
                    restarts,
                    last_death,
                    received,
                    processor_share: share,
                    cpu_s: usage.map(|usage| usage.cpu_s),
                    own_bytes: usage.map(|usage| usage.own_bytes),
                }
            },
        );
        let processes = processes.collect();
        self.before = after;
        Some((status, processes))
    }
}

impl Process {
    /// Marks it as ended, with the run.
    pub fn end(&mut self) {
        (self.state, self.level) = ("ended", "off");
        (self.processor_share, self.cpu_s, self.own_bytes) = (None, None, None);
    }
}

fn level(activity: Activity) -> &'static str {
    match activity {
        Activity::Waiting | Activity::Working | Activity::Running => "good",
        Activity::Starting => "warn",
        Activity::Silent | Activity::Ended => "bad",
    }
}
