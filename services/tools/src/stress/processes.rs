//! The resources that the processes of a run use.

mod members;

use std::{
    collections::BTreeMap,
    path::Path,
    time::{Duration, Instant},
};

use gyre_messages::{FollowerId, StageId};
use gyre_supervise::Usage;
use serde::Serialize;

use members::Members;

/// The resources that the processes of one name used while a run was measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cost {
    /// The stage, the follower, `supervisor`, `guardian` or `other`.
    pub name: String,
    /// Processor time, % of one processor.
    pub cpu_percent: f64,
    /// Largest own memory of all of them at once, MB: without files and shared memory.
    pub own_mb: f64,
    /// Wake-ups a second.
    pub wake_ups_per_s: f64,
    /// Times a second that a thread was taken off a processor while it had work.
    pub preemptions_per_s: f64,
    /// Processes of this name: those that a stage has started, and those after restarts, included.
    pub processes: usize,
}

/// Samples the processes of a run through `/proc`.
#[derive(Debug)]
pub struct Sampler {
    members: Members,
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
            members: Members::of(supervisor, out),
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
        for member in self.members.living() {
            let Some(usage) = Usage::of(member.pid) else {
                continue;
            };
            *own_bytes.entry(member.name.clone()).or_default() += usage.own_bytes;
            let seen = self.seen.entry(member.pid).or_insert_with(|| Seen {
                name: member.name.clone(),
                first: Usage::default(),
                last: usage,
            });
            // The process is named `other` until the supervisor has published its name.
            seen.name = member.name;
            seen.last = usage;
        }
        for (name, bytes) in own_bytes {
            let largest = self.own_bytes.entry(name).or_default();
            *largest = bytes.max(*largest);
        }
    }

    /// Returns the process group of a stage as of now.
    pub fn group_of(&mut self, stage: &str) -> Option<u32> {
        self.members.group_of(stage)
    }

    /// Ends the measurement.
    pub fn costs(mut self) -> Vec<Cost> {
        self.sample();
        let elapsed = self.began.elapsed();
        let mut names: Vec<String> = self.seen.values().map(|seen| seen.name.clone()).collect();
        names.sort_by_key(|name| (rank(name), name.clone()));
        names.dedup();
        let of = |name: &str| {
            let seen = self.seen.values().filter(|seen| seen.name == name);
            let own_bytes = self.own_bytes.get(name).copied().unwrap_or_default();
            cost(name, &seen.collect::<Vec<_>>(), own_bytes, elapsed)
        };
        names.iter().map(|name| of(name)).collect()
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
    let place = names.chain(FollowerId::ALL.map(FollowerId::name));
    place
        .into_iter()
        .position(|known| known == name)
        .unwrap_or(usize::MAX)
}
