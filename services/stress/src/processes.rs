//! What the processes of a run use.

use std::{
    collections::BTreeMap,
    time::{Duration, Instant},
};

use gyre_messages::{FollowerId, StageId};
use gyre_stage::usage::Usage;
use procfs::process::{Process, all_processes};
use serde::Serialize;

/// What the processes of one name have used while a run was measured.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Cost {
    /// The stage, the follower, `supervisor` or `guardian`.
    pub name: String,
    /// Processor time, % of one processor.
    pub cpu_percent: f64,
    /// Largest own memory, MB: without files and shared memory.
    pub own_mb: f64,
    /// Wake-ups a second.
    pub wake_ups_per_s: f64,
    /// Times a second that a thread was taken off a processor while it had work.
    pub preemptions_per_s: f64,
    /// Processes of this name, those after restarts included.
    pub processes: usize,
}

/// Samples the processes of a run through `/proc`.
#[derive(Debug)]
pub struct Sampler {
    supervisor: u32,
    began: Instant,
    /// By process: its name, and its usage at first and at last.
    seen: BTreeMap<u32, Seen>,
    living: BTreeMap<String, u32>,
}

#[derive(Debug)]
struct Seen {
    name: String,
    first: Usage,
    last: Usage,
    own_bytes: u64,
}

impl Sampler {
    /// Begins now.
    pub fn new(supervisor: u32) -> Self {
        let mut sampler = Self {
            supervisor,
            began: Instant::now(),
            seen: BTreeMap::new(),
            living: BTreeMap::new(),
        };
        sampler.sample();
        // What they had used before the measurement does not count.
        let seen = sampler.seen.values_mut();
        seen.for_each(|seen| seen.first = seen.last);
        sampler
    }

    /// Looks at all processes.
    pub fn sample(&mut self) {
        self.living = living(self.supervisor);
        for (name, pid) in &self.living {
            let Some(usage) = Usage::of(*pid) else {
                continue;
            };
            let seen = self.seen.entry(*pid).or_insert_with(|| Seen {
                name: name.clone(),
                first: Usage::default(),
                last: usage,
                own_bytes: 0,
            });
            seen.last = usage;
            seen.own_bytes = seen.own_bytes.max(usage.own_bytes);
        }
    }

    /// Returns the process of a stage as of now.
    pub fn process_of(&self, stage: &str) -> Option<u32> {
        living(self.supervisor).get(stage).copied()
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
            cost(name, &seen.collect::<Vec<_>>(), elapsed)
        };
        names.iter().map(|name| of(name)).collect()
    }
}

fn cost(name: &str, seen: &[&Seen], elapsed: Duration) -> Cost {
    let shares = seen
        .iter()
        .map(|seen| seen.last.processor_share(&seen.first, elapsed));
    let per_s = |of: fn(&Usage) -> u64| {
        let counts = seen
            .iter()
            .map(|it| of(&it.last) - of(&it.first).min(of(&it.last)));
        counts.sum::<u64>() as f64 / elapsed.as_secs_f64().max(1e-9)
    };
    let own = seen.iter().map(|seen| seen.own_bytes).max();
    Cost {
        name: name.to_owned(),
        cpu_percent: 100.0 * shares.sum::<f64>(),
        own_mb: own.unwrap_or(0) as f64 * 1e-6,
        wake_ups_per_s: per_s(|usage| usage.wake_ups),
        preemptions_per_s: per_s(|usage| usage.preemptions),
        processes: seen.len(),
    }
}

/// The living processes of a run by name.
fn living(supervisor: u32) -> BTreeMap<String, u32> {
    let processes = all_processes().into_iter().flatten().flatten();
    let children = processes.filter(|process| {
        let stat = process.stat();
        stat.is_ok_and(|stat| stat.ppid == supervisor as i32 && stat.state != 'Z')
    });
    let named = children.filter_map(|process| Some((name_of(&process)?, process.pid as u32)));
    named
        .chain([("supervisor".to_owned(), supervisor)])
        .collect()
}

/// `gyre stage NAME`, or a program that is called like the stage that it replaces.
fn name_of(process: &Process) -> Option<String> {
    let line = process.cmdline().ok()?;
    let last = line.iter().rfind(|word| !word.is_empty())?;
    let name = std::path::Path::new(last).file_stem()?.to_str()?;
    if name == "guard" {
        return Some("guardian".to_owned());
    }
    let is_known = StageId::by_name(name).is_some() || FollowerId::by_name(name).is_some();
    is_known.then(|| name.to_owned())
}

/// The place of a name in a table: supervisor, the stages in the order of the stream, followers, others.
fn rank(name: &str) -> usize {
    let stages = StageId::ALL.iter().map(|stage| stage.name());
    let names = ["supervisor"].into_iter().chain(stages);
    let place = names.chain(FollowerId::ALL.map(FollowerId::name));
    place
        .into_iter()
        .position(|known| known == name)
        .unwrap_or(usize::MAX)
}
