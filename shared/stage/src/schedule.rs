//! The schedule of the source: how many scans it has published, and when the next one is due. The supervisor reads it, since only
//! the source can tell a gap in the recording from a source that hangs.

use std::{
    fs::{File, OpenOptions},
    os::unix::fs::{FileExt, OpenOptionsExt},
    path::PathBuf,
};

use crate::{Manifest, StageError, clock};

/// The name of the file in the run's root: [`Schedule::published`], then [`Schedule::due_ns`], each as eight bytes, little-endian.
const FILE: &str = "source.schedule";

/// The state of the source.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Schedule {
    /// One more than `Item::published` of the newest item; 0 before the first one.
    pub published: u64,
    /// Time at which the next item is due if the window admits it, `CLOCK_MONOTONIC`, ns.
    pub due_ns: i64,
}

impl Schedule {
    /// Returns whether the next item is overdue.
    pub fn is_late(&self) -> bool {
        clock::now_ns() > self.due_ns
    }

    fn to_bytes(self) -> [u8; 16] {
        let mut bytes = [0; 16];
        bytes[..8].copy_from_slice(&self.published.to_le_bytes());
        bytes[8..].copy_from_slice(&self.due_ns.to_le_bytes());
        bytes
    }

    fn from_bytes(bytes: [u8; 16]) -> Self {
        let [published, due_ns] = [0, 8].map(|at| {
            let mut half = [0; 8];
            half.copy_from_slice(&bytes[at..at + 8]);
            half
        });
        Self {
            published: u64::from_le_bytes(published),
            due_ns: i64::from_le_bytes(due_ns),
        }
    }
}

/// Writes the schedule.
pub(crate) struct ScheduleWriter {
    path: PathBuf,
    file: File,
    /// Items that the source before has published.
    before: u64,
    schedule: Schedule,
}

impl ScheduleWriter {
    /// Creates the schedule of a source that has to begin now.
    pub fn create(manifest: &Manifest) -> Result<Self, StageError> {
        Self::begin(manifest, 0)
    }

    /// Goes on after the source before, which has died. What it published is numbered, but no pose of it is owed: its scans may be
    /// lost.
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
        };
        writer.write()?;
        Ok(writer)
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
        let written = self.file.write_all_at(&self.schedule.to_bytes(), 0);
        written.map_err(|source| StageError::File {
            path: self.path.clone(),
            source,
        })
    }
}

/// Returns the schedule of the run's source, if it has written one: a replaced source need not.
pub(crate) fn read(manifest: &Manifest) -> Option<Schedule> {
    let mut bytes = [0; 16];
    let file = File::open(manifest.root.join(FILE)).ok()?;
    file.read_exact_at(&mut bytes, 0).ok()?;
    Some(Schedule::from_bytes(bytes))
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
        assert_eq!(Schedule::from_bytes(schedule.to_bytes()), schedule);
        assert_eq!(schedule.to_bytes()[..8], (1_u64 << 40).to_le_bytes());
    }
}
