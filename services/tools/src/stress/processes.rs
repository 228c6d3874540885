//! The resources that the processes of a run use.
//!
//! The supervisor knows its stages whatever their programs are called. Each leads a process group,
//! with the processes that it starts, as those behind a shell.

use std::{
    collections::BTreeMap,
    fs,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use gyre_messages::{FollowerId, StageId};
use gyre_stage::control::Control;
use gyre_supervise::{ProcessStat, Usage};
use serde::Serialize;

/// The resources that the processes of one name used while a run was measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cost {
    /// The stage, the follower, `supervisor`, `guardian` or `other`.
    pub name: String,
    /// Processor time, % of one processor.
    pub cpu_percent: f64,
    /// Largest own memory of all of them at once, MB: without files and shared memory.
    pub own_mb: f64,
    pub wake_ups_per_s: f64,
    /// Times a second that a thread was taken off a processor while it had work.
    pub preemptions_per_s: f64,
    /// Processes of this name: those that a stage has started, and those after restarts, included.
    pub processes: usize,
}

/// Samples the processes of a run through `/proc`.
#[derive(Debug)]
pub struct Sampler {
    supervisor: u32,
    out: PathBuf,
    /// The names of the process groups that have been seen.
    names: BTreeMap<u32, String>,
    began: Instant,
    /// By process: its name, and its usage at first and at last.
    seen: BTreeMap<u32, Seen>,
    /// By name: the largest own memory of all its processes at once.
    own_bytes: BTreeMap<String, u64>,
}

#[derive(Debug)]
struct Seen {
    name: String,
    first: Usage,
    last: Usage,
}

impl Sampler {
    /// Begins now: the processes of the run that `supervisor` supervises, and that writes to `out`.
    pub fn new(supervisor: u32, out: &Path) -> Self {
        let mut sampler = Self {
            supervisor,
            out: out.to_owned(),
            names: BTreeMap::new(),
            began: Instant::now(),
            seen: BTreeMap::new(),
            own_bytes: BTreeMap::new(),
        };
        sampler.sample();
        // Their usage before the measurement does not count.
        let seen = sampler.seen.values_mut();
        seen.for_each(|seen| seen.first = seen.last);
        sampler
    }

    /// Reads the usage of all processes.
    pub fn sample(&mut self) {
        let mut own_bytes: BTreeMap<String, u64> = BTreeMap::new();
        let rows = self.rows();
        for (pid, name) in members(&rows, self.supervisor, &self.names) {
            let Some(usage) = Usage::of(pid) else {
                continue;
            };
            *own_bytes.entry(name.to_owned()).or_default() += usage.own_bytes;
            let seen = self.seen.entry(pid).or_insert_with(|| Seen {
                name: String::new(),
                first: Usage::default(),
                last: usage,
            });
            // The process is named `other` until the supervisor has published its name.
            name.clone_into(&mut seen.name);
            seen.last = usage;
        }
        for (name, bytes) in own_bytes {
            let largest = self.own_bytes.entry(name).or_default();
            *largest = bytes.max(*largest);
        }
    }

    pub fn group_of(&mut self, stage: &str) -> Option<u32> {
        let rows = self.rows();
        let mut children = rows.iter().filter(|row| row.parent == self.supervisor);
        let name = |pid: u32| self.names.get(&pid).map(String::as_str);
        let child = children.find(|row| name(row.pid) == Some(stage));
        child.map(|row| row.group)
    }

    /// Returns the living processes of the machine. If one of the supervisor's has no name, the
    /// supervisor is asked for it.
    fn rows(&mut self) -> Vec<ProcessStat> {
        let rows: Vec<_> = ProcessStat::all().filter(|it| !it.has_ended).collect();
        let children = || rows.iter().filter(|row| row.parent == self.supervisor);
        if children().all(|row| self.names.contains_key(&row.pid)) {
            return rows;
        }
        // It may be ending.
        let status = Control::of(&self.out).and_then(|run| run.status());
        let processes = status.into_iter().flat_map(|status| status.processes);
        let mut names: BTreeMap<_, _> = processes.map(|it| (it.pid, it.name)).collect();
        for row in children() {
            if !names.contains_key(&row.pid) && is_guardian(row.pid) {
                names.insert(row.pid, "guardian".to_owned());
            }
        }
        self.names.extend(names);
        rows
    }

    pub fn costs(mut self) -> Vec<Cost> {
        self.sample();
        let elapsed = self.began.elapsed();
        let mut names: Vec<&str> = self.seen.values().map(|seen| seen.name.as_str()).collect();
        names.sort_by_key(|name| (rank(name), *name));
        names.dedup();
        let of = |name: &str| {
            let seen = self.seen.values().filter(|seen| seen.name == name);
            let own_bytes = self.own_bytes.get(name).copied().unwrap_or_default();
            cost(name, &seen.collect::<Vec<_>>(), own_bytes, elapsed)
        };
        names.into_iter().map(of).collect()
    }
}

fn cost(name: &str, seen: &[&Seen], own_bytes: u64, elapsed: Duration) -> Cost {
    let shares = seen
        .iter()
        .map(|seen| seen.last.processor_share(&seen.first, elapsed));
    let per_s = |of: fn(&Usage) -> u64| {
        let counts = seen
            .iter()
            .map(|it| of(&it.last) - of(&it.first).min(of(&it.last)));
        counts.sum::<u64>() as f64 / elapsed.as_secs_f64().max(1e-9)
    };
    Cost {
        name: name.to_owned(),
        cpu_percent: 100.0 * shares.sum::<f64>(),
        own_mb: own_bytes as f64 * 1e-6,
        wake_ups_per_s: per_s(|usage| usage.wake_ups),
        preemptions_per_s: per_s(|usage| usage.preemptions),
        processes: seen.len(),
    }
}

/// The place of a name in a table: supervisor, the stages in the order of the stream, followers,
/// others.
fn rank(name: &str) -> usize {
    let stages = StageId::ALL.iter().map(|stage| stage.name());
    let names = ["supervisor"].into_iter().chain(stages);
    let mut names = names.chain(FollowerId::ALL.map(FollowerId::name));
    names.position(|known| known == name).unwrap_or(usize::MAX)
}

/// Returns the supervisor, its children, and all that are in their groups, with their names.
fn members<'a>(
    rows: &[ProcessStat],
    supervisor: u32,
    names: &'a BTreeMap<u32, String>,
) -> Vec<(u32, &'a str)> {
    let children = rows.iter().filter(|row| row.parent == supervisor);
    let name = |pid: u32| names.get(&pid).map_or("other", String::as_str);
    let leaders: BTreeMap<u32, &str> = children.map(|row| (row.pid, name(row.pid))).collect();
    let named = rows.iter().filter_map(|row| {
        let leader = || leaders.get(&row.pid).or_else(|| leaders.get(&row.group));
        match row.pid == supervisor {
            true => Some((row.pid, "supervisor")),
            false => Some((row.pid, *leader()?)),
        }
    });
    named.collect()
}

/// `gyre guard`, which no stage is.
fn is_guardian(pid: u32) -> bool {
    let line = fs::read_to_string(format!("/proc/{pid}/cmdline"));
    line.is_ok_and(|line| line.trim_end_matches('\0').ends_with("\0guard"))
}

#[cfg(test)]
mod tests {
    use super::*;

    const SUPERVISOR: u32 = 10;

    fn row(pid: u32, parent: u32, group: u32) -> ProcessStat {
        ProcessStat {
            pid,
            parent,
            group,
            ..ProcessStat::default()
        }
    }

    #[test]
    fn what_a_stage_has_started_belongs_to_it_also_when_its_parent_has_ended() {
        let rows = [
            row(1, 0, 1),
            row(SUPERVISOR, 1, 1),
            // A shell, its child, a grandchild whose parent has ended, and one that nobody knows
            // yet.
            row(20, SUPERVISOR, 20),
            row(21, 20, 20),
            row(22, 1, 20),
            row(30, SUPERVISOR, 30),
            // Of the terminal of the supervisor, and of another run.
            row(40, 1, 1),
            row(51, 50, 51),
        ];
        let names = [(20, "masking".to_owned())].into();
        let named = members(&rows, SUPERVISOR, &names);
        let masking = [(20, "masking"), (21, "masking"), (22, "masking")];
        let expected = [&[(10, "supervisor")][..], &masking, &[(30, "other")]].concat();
        assert_eq!(named, expected);
    }
}
