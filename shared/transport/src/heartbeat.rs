//! The heartbeat of a process, a file in the run's root: written when a wait begins and ends, every
//! 200 ms or more often, and by a stage before each item. A process that works has a beat as old as
//! its work; one that is stopped, or not run by the system, has an old beat of a wait.

use std::{
    fs::OpenOptions,
    process,
    sync::atomic::{AtomicU64, Ordering},
    time::Duration,
};

use memmap2::{MmapOptions, MmapRaw};

use crate::{
    Manifest, RunError, clock,
    numbers::{self, Numbers},
};

/// The longest wait of a process, so the longest time between two beats of one that works on
/// nothing.
pub const MAX_WAIT: Duration = Duration::from_millis(200);
/// A waiting process beats at least every [`MAX_WAIT`]. Beyond this time it is stopped, or not run
/// by the system.
const SILENT: Duration = MAX_WAIT.saturating_mul(5);

/// The activity of a process, by its number in the file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activity {
    Works = 1,
    Waits = 2,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heartbeat {
    /// Time when the activity began, `CLOCK_MONOTONIC`, ns.
    pub since_ns: i64,
    pub pid: u32,
    pub activity: Activity,
}

impl Heartbeat {
    pub fn age(&self) -> Duration {
        Duration::from_nanos(clock::now_ns().saturating_sub(self.since_ns).max(0) as u64)
    }

    /// Returns whether the process waits, but has not woken when its wait ended.
    pub fn is_silent(&self) -> bool {
        self.activity == Activity::Waits && self.age() > SILENT
    }

    /// Returns whether the process has not come to its next wait, or out of the last one, within
    /// `limit`.
    pub fn hangs(&self, limit: Duration) -> bool {
        self.age() > limit.max(SILENT)
    }

    /// The time, then the process and the activity in 32 bits each.
    fn to_numbers(self) -> [u64; 2] {
        let activity = (self.activity as u64) << 32;
        [self.since_ns as u64, activity | u64::from(self.pid)]
    }

    fn of([since_ns, of_process]: [u64; 2]) -> Option<Self> {
        Some(Self {
            since_ns: since_ns as i64,
            pid: of_process as u32,
            activity: match of_process >> 32 {
                1 => Activity::Works,
                2 => Activity::Waits,
                _ => return None,
            },
        })
    }
}

/// Writes beats through a mapping of the file: the beat at the end of a wait is part of the
/// latency, and a system call would take longer.
#[derive(Debug)]
pub struct HeartbeatWriter(MmapRaw);

impl HeartbeatWriter {
    /// Begins with a beat of a process that works: with no memory left for the file this fails, and
    /// a later beat cannot.
    pub fn create(manifest: &Manifest, process: &str) -> Result<Self, RunError> {
        let name = file_of(process);
        Numbers::open(manifest, &name)?.write(now(Activity::Works))?;
        let path = manifest.root.join(name);
        let opened = OpenOptions::new().read(true).write(true).open(&path);
        let mapped = opened.and_then(|file| MmapOptions::new().len(16).map_raw(&file));
        Ok(Self(mapped.map_err(RunError::file(&path))?))
    }

    pub fn beat(&self, activity: Activity) {
        let first: *mut AtomicU64 = self.0.as_mut_ptr().cast();
        // The time is stored first: a reader in between sees the new time with the old activity.
        for (at, number) in now(activity).into_iter().enumerate() {
            // SAFETY: the mapping begins at a page, has two numbers, and lives as long as `self`;
            // other processes only read the file.
            let mapped = unsafe { &*first.add(at) };
            mapped.store(number.to_le(), Ordering::Relaxed);
        }
    }
}

fn now(activity: Activity) -> [u64; 2] {
    let beat = Heartbeat {
        since_ns: clock::now_ns(),
        pid: process::id(),
        activity,
    };
    beat.to_numbers()
}

/// Returns the newest beat of a process, if it writes any: a replacement need not.
pub fn read(manifest: &Manifest, process: &str, pid: u32) -> Option<Heartbeat> {
    let numbers = numbers::read(&manifest.root.join(file_of(process)))?;
    // The process before has left its last one.
    Heartbeat::of(numbers).filter(|beat| beat.pid == pid)
}

fn file_of(process: &str) -> String {
    format!("{process}.heartbeat")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn beat(activity: Activity, age: Duration) -> Heartbeat {
        Heartbeat {
            since_ns: clock::now_ns() - age.as_nanos() as i64,
            pid: 7,
            activity,
        }
    }

    #[test]
    fn a_beat_is_read_as_it_was_written() {
        for activity in [Activity::Works, Activity::Waits] {
            let beat = beat(activity, Duration::ZERO);
            assert_eq!(Heartbeat::of(beat.to_numbers()), Some(beat));
        }
        assert_eq!(Heartbeat::of([0; 2]), None);
    }

    #[test]
    fn long_work_is_not_silence_and_a_wait_without_end_is() {
        let minute = Duration::from_secs(60);
        let works = beat(Activity::Works, minute);
        assert!(!works.is_silent() && beat(Activity::Waits, minute).is_silent());
        assert!(works.hangs(Duration::from_secs(59)) && !works.hangs(Duration::from_secs(61)));
        let waits = beat(Activity::Waits, MAX_WAIT);
        assert!(!waits.is_silent() && !waits.hangs(Duration::ZERO));
    }
}
