//! The heartbeat of a process: whether it waits or works, and since when. It distinguishes a
//! process that hangs from one that waits.
//!
//! Each process of a run writes it to a file in the run's root whenever it begins and ends a wait,
//! which is every 200 ms or more often, and a stage also before each item. So a process that works
//! has a beat as old as its work, and a process that is stopped, or that the system does not run,
//! has an old beat that reports a wait.

use std::{
    fs::{File, OpenOptions},
    os::unix::fs::{FileExt, OpenOptionsExt},
    path::PathBuf,
    process,
    sync::atomic::{AtomicU64, Ordering},
    time::Duration,
};

use memmap2::{MmapOptions, MmapRaw};

use crate::{Manifest, StageError, clock};

/// The longest wait of a process, so the longest time between two beats of one that works on
/// nothing.
pub const MAX_WAIT: Duration = Duration::from_millis(200);
/// Size of the file: the time of the beat (i64), the process (u32) and the activity (u32),
/// little-endian.
const BYTES: usize = 16;
/// A waiting process beats at least every [`MAX_WAIT`]. Beyond this time it is stopped, or not run
/// by the system.
const SILENT: Duration = MAX_WAIT.saturating_mul(5);

/// The activity of a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Activity {
    /// It works on an item.
    Works,
    /// It sleeps until there is work.
    Waits,
}

/// The newest beat of a process.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Heartbeat {
    /// Time when the activity began, `CLOCK_MONOTONIC`, ns.
    pub since_ns: i64,
    pub pid: u32,
    pub activity: Activity,
}

impl Heartbeat {
    fn now(activity: Activity, pid: u32) -> Self {
        Self {
            since_ns: clock::now_ns(),
            pid,
            activity,
        }
    }

    /// Returns for how long the activity has lasted.
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

    fn to_bytes(self) -> [u8; BYTES] {
        let activity = match self.activity {
            Activity::Works => 1_u32,
            Activity::Waits => 2,
        };
        let mut bytes = [0; BYTES];
        bytes[..8].copy_from_slice(&self.since_ns.to_le_bytes());
        bytes[8..12].copy_from_slice(&self.pid.to_le_bytes());
        bytes[12..].copy_from_slice(&activity.to_le_bytes());
        bytes
    }

    fn from_bytes(bytes: [u8; BYTES]) -> Option<Self> {
        let (since, rest) = bytes.split_first_chunk()?;
        let (pid, rest) = rest.split_first_chunk()?;
        let (activity, _) = rest.split_first_chunk()?;
        Some(Self {
            since_ns: i64::from_le_bytes(*since),
            pid: u32::from_le_bytes(*pid),
            activity: match u32::from_le_bytes(*activity) {
                1 => Activity::Works,
                2 => Activity::Waits,
                _ => return None,
            },
        })
    }
}

/// Writes the beats of this process, through a mapping of the file: the beat at the end of a wait
/// is part of the latency, and a system call would take longer.
#[derive(Debug)]
pub(crate) struct HeartbeatWriter {
    mapped: MmapRaw,
    pid: u32,
}

impl HeartbeatWriter {
    /// Begins with a beat of a process that works.
    pub fn create(manifest: &Manifest, process: &str) -> Result<Self, StageError> {
        let path = path_of(manifest, process);
        let opened = OpenOptions::new()
            .create(true)
            .truncate(false)
            .read(true)
            .write(true)
            .mode(0o600)
            .open(&path);
        let pid = process::id();
        let first = Heartbeat::now(Activity::Works, pid);
        let mapped = opened.and_then(|file| {
            // Its memory exists from here on: with none left this fails, and a beat cannot.
            file.write_all_at(&first.to_bytes(), 0)?;
            MmapOptions::new().len(BYTES).map_raw(&file)
        });
        Ok(Self {
            mapped: mapped.map_err(|source| StageError::File { path, source })?,
            pid,
        })
    }

    /// Reports that an activity begins now.
    pub fn beat(&self, activity: Activity) {
        let bytes = Heartbeat::now(activity, self.pid).to_bytes();
        let (words, _) = bytes.as_chunks();
        let first: *mut AtomicU64 = self.mapped.as_mut_ptr().cast();
        for (at, word) in words.iter().enumerate() {
            // SAFETY: the mapping begins at a page, is as long as the words, and lives as long as
            // this; other processes only read the file.
            let mapped = unsafe { &*first.add(at) };
            // One that reads in between has the time of this beat with the activity before, for
            // less than a microsecond.
            mapped.store(u64::from_ne_bytes(*word), Ordering::Relaxed);
        }
    }
}

/// Returns the newest beat of a process, if it writes any: a replacement need not.
pub fn read(manifest: &Manifest, process: &str, pid: u32) -> Option<Heartbeat> {
    let mut bytes = [0; BYTES];
    let file = File::open(path_of(manifest, process)).ok()?;
    file.read_exact_at(&mut bytes, 0).ok()?;
    // The process before has left its last one.
    Heartbeat::from_bytes(bytes).filter(|beat| beat.pid == pid)
}

fn path_of(manifest: &Manifest, process: &str) -> PathBuf {
    manifest.root.join(format!("{process}.heartbeat"))
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
            assert_eq!(Heartbeat::from_bytes(beat.to_bytes()), Some(beat));
        }
        assert_eq!(Heartbeat::from_bytes([0; BYTES]), None);
    }

    #[test]
    fn long_work_is_not_silence_and_a_wait_without_end_is() {
        let minute = Duration::from_secs(60);
        assert!(!beat(Activity::Works, minute).is_silent());
        assert!(beat(Activity::Waits, minute).is_silent());
        assert!(!beat(Activity::Waits, MAX_WAIT).is_silent());
        assert!(beat(Activity::Works, minute).hangs(Duration::from_secs(59)));
        assert!(!beat(Activity::Works, minute).hangs(Duration::from_secs(61)));
        assert!(
            !beat(Activity::Waits, MAX_WAIT).hangs(Duration::ZERO),
            "it need not beat before its wait ends"
        );
    }
}
