//! The processes of the run: their states by the supervisor, and their usage by the kernel.

use std::{collections::BTreeMap, mem, path::Path, time::Instant};

use gyre_client::{Usage, control::Control};
use gyre_contract::control::{Activity, Received, Status};
use serde::Serialize;

const SUPERVISOR: &str = "supervisor";

#[derive(Debug, Default)]
pub struct ProcessMeter {
    before: BTreeMap<u32, (Instant, Usage)>,
}

#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Process {
    pub name: String,
    pub pid: u32,
    pub state: &'static str,
    /// The rating of the activity: `good`, `warn`, or `bad`.
    pub level: &'static str,
    pub restarts: usize,
    pub last_death: Option<String>,
    /// The counts of a live radar; `None` if the process receives none.
    pub received: Option<Received>,
    /// Share of one processor since the last read; `None` at the first.
    pub processor_share: Option<f64>,
    /// Processor time since the start, s; `None` if the process has just ended.
    pub cpu_s: Option<f64>,
    /// Memory of its own, bytes; `None` if the process has just ended.
    pub own_bytes: Option<u64>,
}

impl ProcessMeter {
    /// Returns the supervisor's status of the run that writes to `out`, and its processes. `None`
    /// if there is no answer: the run is about to end, or its supervisor is stopped.
    pub fn read(&mut self, out: &Path) -> Option<(Status, Vec<Process>)> {
        let status = Control::of(out).and_then(|control| control.status()).ok()?;
        let others = status.processes.iter().map(|it| Process {
            name: it.name.clone(),
            pid: it.pid,
            state: it.activity.name(),
            level: level(it.activity),
            restarts: it.restarts,
            last_death: it.last_death.clone(),
            received: it.received,
            ..Process::default()
        });
        let supervisor = Process {
            name: SUPERVISOR.to_owned(),
            pid: status.pid,
            state: "running",
            level: "good",
            ..Process::default()
        };
        let mut processes: Vec<_> = [supervisor].into_iter().chain(others).collect();
        let (now, earlier) = (Instant::now(), mem::take(&mut self.before));
        for process in &mut processes {
            let Some(usage) = Usage::of(process.pid) else {
                continue;
            };
            let before = earlier.get(&process.pid);
            process.processor_share =
                before.map(|(at, before)| usage.processor_share(before, now - *at));
            process.cpu_s = Some(usage.cpu_s);
            process.own_bytes = Some(usage.own_bytes);
            self.before.insert(process.pid, (now, usage));
        }
        Some((status, processes))
    }
}

impl Process {
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
