//! Main memory, shared memory, and room for results.

use std::path::Path;

use gyre_messages::Footprint;
use gyre_stage::run::{SHARED_MEMORY, free_shared_memory};
use gyre_supervise::memory::Room;
use rustix::fs::{Access, access, statfs, statvfs};

use crate::doctor::Finding;

/// The `f_type` of a tmpfs.
const TMPFS: i128 = 0x0102_1994;
/// Memory of the processes of a run beside shared memory. Measured: 50 MB, a network up to 100 MB
/// more.
const PROCESSES: u64 = 60_000_000;
/// Room for results without which no run starts: the map of the refinement takes 10 MB, 55 MB with
/// the largest window.
const RESULTS: u64 = 64_000_000;
/// Results of a scan: its lines of the results, its record in the journal.
const RESULTS_PER_SCAN: u64 = 1_000;

pub fn main_memory(footprint: &Footprint) -> Finding {
    let needed = footprint.total() as u64 + PROCESSES;
    let Room {
        available, limit, ..
    } = Room::now();
    let parts = [
        available.map(|bytes| format!("{} available", size(bytes))),
        limit.map(|bytes| format!("this process's group may use {}", size(bytes))),
    ];
    let found = parts.into_iter().flatten().collect::<Vec<_>>().join(", ");
    let found = Finding::good("memory", format!("{found}; a run needs {}", size(needed)));
    match available.into_iter().chain(limit).min() {
        Some(least) if least < needed => found.bad(
            "end other programs, or raise the limit (containers: --memory); shared memory counts towards it",
        ),
        _ => found,
    }
}

pub fn shared_memory(footprint: &Footprint) -> Finding {
    let needed = footprint.total() as u64;
    let nothing = |found: String| {
        Finding::good("shared memory", found).bad(format!("mount a tmpfs at {SHARED_MEMORY}"))
    };
    let (kind, free) = match (statfs(SHARED_MEMORY), free_shared_memory()) {
        (Ok(kind), Ok(free)) => (kind, free),
        (Err(error), _) | (_, Err(error)) => return nothing(format!("{SHARED_MEMORY}: {error}")),
    };
    let is_tmpfs = kind.f_type as i128 == TMPFS;
    let room = free.map_or("no limit".to_owned(), |free| format!("{} free", size(free)));
    let kind = if is_tmpfs { "tmpfs" } else { "no tmpfs" };
    let found = format!(
        "{SHARED_MEMORY}: {kind}, {room}; a run with default settings needs {}",
        size(needed)
    );
    let found = Finding::good("shared memory", found);
    match (free.is_some_and(|free| free < needed), is_tmpfs) {
        (true, _) => found.bad(format!(
            "enlarge it (`mount -o remount,size=1G {SHARED_MEMORY}`, containers: --shm-size 1g), or lower run.observers, \
             run.window or raster.n"
        )),
        (false, false) => found.limited(format!("recovery and hand-over are slower: mount a tmpfs at {SHARED_MEMORY}")),
        (false, true) => found,
    }
}

pub fn results(out: &Path) -> Finding {
    // The first folder that exists: a run makes the others.
    let absolute = std::path::absolute(out).unwrap_or_else(|_| out.to_owned());
    let there = absolute.ancestors().find(|path| path.exists());
    let there = there.unwrap_or(Path::new("/"));
    let elsewhere = "name another folder with --out";
    let folder = there.display();
    let finding = |found: String| Finding::good("results", found);
    let disk = match statvfs(there) {
        Ok(disk) => disk,
        Err(error) => return finding(format!("{folder}: {error}")).bad(elsewhere),
    };
    if !there.is_dir() || access(there, Access::WRITE_OK).is_err() {
        return finding(format!("{folder}: cannot be written to")).bad(elsewhere);
    }
    let free = disk.f_bavail * disk.f_frsize;
    let scans = free.saturating_sub(RESULTS) / RESULTS_PER_SCAN;
    let found = finding(format!(
        "{folder}: {} free, room for {scans} scans",
        size(free)
    ));
    match free < RESULTS {
        true => found.bad(format!("free {} or {elsewhere}", size(RESULTS))),
        false => found,
    }
}

/// `61.2 MB`, `25.3 GB`.
fn size(bytes: u64) -> String {
    match bytes {
        0..1_000_000_000 => format!("{:.1} MB", bytes as f64 / 1e6),
        _ => format!("{:.1} GB", bytes as f64 / 1e9),
    }
}
