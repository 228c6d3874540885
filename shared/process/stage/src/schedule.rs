//! The schedule of the source: how many scans it has published, and when the next one is due. The
//! supervisor reads it, since only the source can distinguish a gap in the recording from a source
//! that hangs. And the origin of its pace, for the source after it: scans of a live run become due
//! whether a source is there or not.

use std::{
    fs::{File, OpenOptions},
    os::unix::fs::{FileExt, OpenOptionsExt},
    path::PathBuf,
};

use crate::{Manifest, StageError, clock};

/// The name of the file in the run's root: [`Schedule::published`], then [`Schedule::due_ns`], then
/// the origin of the pace, if there is one: each number as eight bytes, little-endian.
const FILE: &str = "source.schedule";

/// The state of the source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Schedule {
    /// One more than `Item::published` of the newest item; 0 before the first one.
    pub published: u64,
    /// Time when the next item is due if the window admits it, `CLOCK_MONOTONIC`, ns.
    pub due_ns: i64,
}

impl Schedule {
    /// Returns whether the next item is overdue.
    pub fn is_late(&self) -> bool {
        clock::now_ns() > self.due_ns
    }

    fn to_bytes(self) -> [u8; 16] {
        to_bytes(self.published as i64, self.due_ns)
    }

    fn of((published, due_ns): (i64, i64)) -> Self {
        Self {
            published: published as u64,
            due_ns,
        }
    }
}

fn to_bytes(first: i64, second: i64) -> [u8; 16] {
    let mut bytes = [0; 16];
    bytes[..8].copy_from_slice(&first.to_le_bytes());
    bytes[8..].copy_from_slice(&second.to_le_bytes());
    bytes
}

fn from_bytes(bytes: [u8; 16]) -> (i64, i64) {
    let [first, second] = [0, 8].map(|at| {
        let mut half = [0; 8];
        half.copy_from_slice(&bytes[at..at + 8]);
        i64::from_le_bytes(half)
    });
    (first, second)
}

pub(crate) struct ScheduleWriter {
    path: PathBuf,
    file: File,
    /// Items that the source before has published.
    before: u64,
    schedule: Schedule,
    /// The time of the run and the time of the sensor that it stands for, ns.
    origin: Option<(i64, i64)>,
}

/// Position of the origin in the file.
const ORIGIN_AT: u64 = 16;

impl ScheduleWriter {
    /// Creates the schedule of a source that has to begin now.
    pub fn create(manifest: &Manifest) -> Result<Self, StageError> {
        Self::begin(manifest, 0)
    }

    /// Continues after a dead source. Its published scans are numbered, but no pose is due for
    /// them: they may be lost.
    pub fn resume(manifest: &Manifest) -> Result<Self, StageError> {
        Self::begin(
            manifest,
            read(manifest).map_or(0, |before| before.published),
        )
    }

    /// Returns the number of items that the source before has published.
    pub fn published_before(&self) -> u64 {
        self.before
    }

    fn begin(manifest: &Manifest, before: u64) -> Result<Self, StageError> {
        let path = manifest.root.join(FILE);
        let opened = OpenOptions::new()
            .create(true)
            .truncate(false)
            .write(true)
            .mode(0o600)
            .open(&path);
        let writer = Self {
            file: opened.map_err(|source| StageError::File {
                path: path.clone(),
                source,
            })?,
            path,
            before,
            schedule: Schedule {
                published: 0,
                due_ns: clock::now_ns(),
            },
            origin: read_pair(manifest, ORIGIN_AT),
        };
        writer.write()?;
        Ok(writer)
    }

    /// Returns the origin of the pace of this source or of the one before, if it has a pace.
    pub fn origin(&self) -> Option<(i64, i64)> {
        self.origin
    }

    /// Scans are due by the pace with this origin.
    pub fn is_paced_from(&mut self, origin: (i64, i64)) -> Result<(), StageError> {
        if self.origin == Some(origin) {
            return Ok(());
        }
        self.origin = Some(origin);
        self.write_at(to_bytes(origin.0, origin.1), ORIGIN_AT)
    }

    /// The next item is due at this time.
    pub fn due_at(&mut self, due_ns: i64) -> Result<(), StageError> {
        self.set(Schedule {
            due_ns,
            ..self.schedule
        })
    }

    /// The source has published the item with this `Item::published`.
    pub fn has_published(&mut self, published: u64) -> Result<(), StageError> {
        self.set(Schedule {
            published: published.saturating_add(1),
            ..self.schedule
        })
    }

    fn set(&mut self, schedule: Schedule) -> Result<(), StageError> {
        if schedule == self.schedule {
            return Ok(());
        }
        self.schedule = schedule;
        self.write()
    }

    fn write(&self) -> Result<(), StageError> {
        self.write_at(self.schedule.to_bytes(), 0)
    }

    fn write_at(&self, bytes: [u8; 16], position: u64) -> Result<(), StageError> {
        let written = self.file.write_all_at(&bytes, position);
        written.map_err(|source| StageError::File {
            path: self.path.clone(),
            source,
        })
    }
}

/// Returns the schedule of the run's source, if it has written one: a replaced source need not.
pub fn read(manifest: &Manifest) -> Option<Schedule> {
    read_pair(manifest, 0).map(Schedule::of)
}

/// Returns two numbers of the file; `None` where it has none.
fn read_pair(manifest: &Manifest, position: u64) -> Option<(i64, i64)> {
    let mut bytes = [0; 16];
    let file = File::open(manifest.root.join(FILE)).ok()?;
    file.read_exact_at(&mut bytes, position).ok()?;
    Some(from_bytes(bytes))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_schedule_is_read_as_it_was_written() {
        let schedule = Schedule {
            published: 1 << 40,
            due_ns: -7,
        };
        assert_eq!(Schedule::of(from_bytes(schedule.to_bytes())), schedule);
        assert_eq!(schedule.to_bytes()[..8], (1_u64 << 40).to_le_bytes());
    }
}
