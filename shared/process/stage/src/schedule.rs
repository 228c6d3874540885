//! The schedule of the source: how many scans it has published, and when the next one is due. The
//! supervisor reads it, since only the source can distinguish a gap in the recording from a source
//! that hangs. And the origin of its pace, for the source after it: scans of a live run become due
//! whether a source is there or not.

use crate::{
    Manifest, StageError, clock,
    numbers::{self, Numbers},
};

/// The name of the file in the run's root: [`Schedule::published`], then [`Schedule::due_ns`], then
/// the origin of the pace, if there is one.
const FILE: &str = "source.schedule";
const ORIGIN_AT: u64 = 16;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Schedule {
    /// One more than `Item::published` of the newest item; 0 before the first one.
    pub published: u64,
    /// Time when the next item is due if the window admits it, `CLOCK_MONOTONIC`, ns.
    pub due_ns: i64,
}

impl Schedule {
    pub fn is_late(&self) -> bool {
        clock::now_ns() > self.due_ns
    }
}

pub(crate) struct ScheduleWriter {
    file: Numbers<2>,
    origin_file: Numbers<2>,
    /// Items that the source before has published. No pose is due for them: they may be lost.
    pub before: u64,
    schedule: Schedule,
    /// The time of the run and the time of the sensor that it stands for, ns.
    pub origin: Option<(i64, i64)>,
}

impl ScheduleWriter {
    /// Creates the schedule of a source that has to begin now, maybe after a dead one.
    pub fn create(manifest: &Manifest) -> Result<Self, StageError> {
        let origin: Option<[u64; 2]> = numbers::read(&manifest.root.join(FILE), ORIGIN_AT);
        let mut writer = Self {
            file: Numbers::open(manifest, FILE, 0)?,
            origin_file: Numbers::open(manifest, FILE, ORIGIN_AT)?,
            before: read(manifest).map_or(0, |before| before.published),
            schedule: Schedule {
                published: 0,
                due_ns: clock::now_ns(),
            },
            origin: origin.map(|[run_ns, sensor_ns]| (run_ns as i64, sensor_ns as i64)),
        };
        writer.write()?;
        Ok(writer)
    }

    pub fn is_paced_from(&mut self, origin: (i64, i64)) -> Result<(), StageError> {
        self.origin = Some(origin);
        self.origin_file.write([origin.0 as u64, origin.1 as u64])
    }

    pub fn due_at(&mut self, due_ns: i64) -> Result<(), StageError> {
        self.schedule.due_ns = due_ns;
        self.write()
    }

    pub fn has_published(&mut self, published: u64) -> Result<(), StageError> {
        self.schedule.published = published.saturating_add(1);
        self.write()
    }

    fn write(&mut self) -> Result<(), StageError> {
        let Schedule { published, due_ns } = self.schedule;
        self.file.write([published, due_ns as u64])
    }
}

/// Returns the schedule of the run's source, if it has written one: a replaced source need not.
pub fn read(manifest: &Manifest) -> Option<Schedule> {
    let [published, due_ns] = numbers::read(&manifest.root.join(FILE), 0)?;
    Some(Schedule {
        published,
        due_ns: due_ns as i64,
    })
}
