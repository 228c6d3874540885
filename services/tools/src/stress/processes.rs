//! The resources that the processes of a run use.
//!
//! The supervisor knows its stages whatever their programs are called. Each leads a process group,
//! with the processes that it starts, as those behind a shell.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
    time::Instant,
};

use gyre_client::{ProcessStat, Usage, control::Control};
use gyre_contract::{FollowerId, StageId};
use serde::Serialize;

/// The resources that the processes of one name used while a run was measured.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Cost {
    /// The stage, the follower or `supervisor`.
    pub name: String,
    /// Processor time, % of one processor.
    pub cpu_percent: f64,
    /// Largest own memory of all of them at once, MB: without files and shared memory.
    pub own_mb: f64,
    pub wake_ups_per_s: f64,
    /// Processes of this name: those that a stage has started, and those after restarts, included.
    pub processes: usize,
}

#[derive(Debug)]
pub struct Sampler {
    supervisor: u32,
    out: PathBuf,
    began: Instant,
    /// By name and process: the usage at first and at last.
    seen: BTreeMap<(String, u32), [Usage; 2]>,
    /// By name: the largest own memory of all its processes at once.
    own_bytes: BTreeMap<String, u64>,
}

impl Sampler {
    /// Begins now: the processes of the run that `supervisor` supervises, and that writes to `out`.
    pub fn new(supervisor: u32, out: &Path) -> Self {
        let mut sampler = Self {
            supervisor,
            out: out.to_owned(),
            began: Instant::now(),
            seen: BTreeMap::new(),
            own_bytes: BTreeMap::new(),
        };
        sampler.sample();
        // Their usage before the measurement does not count.
        let seen = sampler.seen.values_mut();
        seen.for_each(|[first, last]| *first = *last);
        sampler
    }

    pub fn sample(&mut self) {
        let leaders = self.leaders();
        let mut own_bytes: BTreeMap<&str, u64> = BTreeMap::new();
        for row in living() {
            let name = match row.pid == self.supervisor {
                true => Some("supervisor"),
                false => leaders.get(&row.group).map(String::as_str),
            };
            let (Some(name), Some(usage)) = (name, Usage::of(row.pid)) else {
                continue;
            };
            *own_bytes.entry(name).or_default() += usage.own_bytes;
            let seen = self.seen.entry((name.to_owned(), row.pid));
            let [_, last] = seen.or_insert([Usage::default(); 2]);
            *last = usage;
        }
        for (name, bytes) in own_bytes {
            let largest = self.own_bytes.entry(name.to_owned()).or_default();
            *largest = bytes.max(*largest);
        }
    }

    /// Returns the process group of a stage; `None` while it is not there.
    pub fn group_of(&self, stage: &str) -> Option<u32> {
        let leaders = self.leaders();
        let mut groups = living().map(|row| row.group);
        groups.find(|group| leaders.get(group).is_some_and(|name| name == stage))
    }

    /// Returns the names of the process groups of the run, as the supervisor reports them; none
    /// while it ends.
    fn leaders(&self) -> BTreeMap<u32, String> {
        let status = Control::of(&self.out).and_then(|run| run.status());
        let processes = status.into_iter().flat_map(|status| status.processes);
        processes.map(|it| (it.pid, it.name)).collect()
    }

    /// Returns the costs of the supervisor, the stages in the order of the stream, and followers.
    pub fn costs(mut self) -> Vec<Cost> {
        self.sample();
        let elapsed = self.began.elapsed();
        let mut costs: BTreeMap<(usize, String), Cost> = BTreeMap::new();
        for ((name, _), [first, last]) in self.seen {
            let cost = costs.entry((rank(&name), name)).or_default();
            let woken = last.wake_ups.saturating_sub(first.wake_ups);
            cost.cpu_percent += 100.0 * last.processor_share(&first, elapsed);
            cost.wake_ups_per_s += woken as f64 / elapsed.as_secs_f64().max(1e-9);
            cost.processes += 1;
        }
        let named = costs.into_iter().map(|((_, name), cost)| Cost {
            own_mb: self
                .own_bytes
                .get(&name)
                .map_or(0.0, |it| *it as f64 * 1e-6),
            name,
            ..cost
        });
        named.collect()
    }
}

fn living() -> impl Iterator<Item = ProcessStat> {
    ProcessStat::all().filter(|it| !it.has_ended)
}

fn rank(name: &str) -> usize {
    let stages = StageId::ALL.iter().map(|stage| stage.name());
    let names = ["supervisor"].into_iter().chain(stages);
    let mut names = names.chain(FollowerId::ALL.map(FollowerId::name));
    names.position(|known| known == name).unwrap_or(usize::MAX)
}
