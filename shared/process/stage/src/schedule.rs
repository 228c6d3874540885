//! The schedule of the source: how many scans it has published, and when the next one is due. The
//! supervisor reads it, since only the source can distinguish a gap in the recording from a source
//! that hangs. And the origin of its pace, for the source after it: scans of a live run become due
//! whether a source is there or not.
//!
//! And the progress of stages on another machine: while those owe something, nobody here does.

use gyre_transport::{
    Manifest, RunError, clock,
    numbers::{self, Numbers},
};

/// The name of the file in the run's root: [`Schedule::published`], then [`Schedule::due_ns`], then
/// the origin of the pace, which a replaced source may leave out; zeros without one.
const FILE: &str = "source.schedule";

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
    file: Numbers<4>,
    /// Items that the source before has published. No pose is due for them: they may be lost.
    pub before: u64,
    schedule: Schedule,
    /// The time of the run and the time of the sensor that it stands for, ns.
    pub origin: Option<(i64, i64)>,
}

impl ScheduleWriter {
    /// Creates the schedule of a source that has to begin now, maybe after a dead one.
    pub fn create(manifest: &Manifest) -> Result<Self, RunError> {
        let [.., run_ns, sensor_ns]: [u64; 4] =
            numbers::read(&manifest.root.join(FILE)).unwrap_or_default();
        let mut writer = Self {
            file: Numbers::open(manifest, FILE)?,
            before: read(manifest).map_or(0, |before| before.published),
            schedule: Schedule {
                published: 0,
                due_ns: clock::now_ns(),
            },
            origin: (run_ns != 0).then_some((run_ns as i64, sensor_ns as i64)),
        };
        writer.write()?;
        Ok(writer)
    }

    pub fn is_paced_from(&mut self, origin: (i64, i64)) -> Result<(), RunError> {
        self.origin = Some(origin);
        self.write()
    }

    pub fn due_at(&mut self, due_ns: i64) -> Result<(), RunError> {
        self.schedule.due_ns = due_ns;
        self.write()
    }

    pub fn has_published(&mut self, published: u64) -> Result<(), RunError> {
        self.schedule.published = published.saturating_add(1);
        self.write()
    }

    fn write(&mut self) -> Result<(), RunError> {
        let Schedule { published, due_ns } = self.schedule;
        let (run_ns, sensor_ns) = self.origin.unwrap_or_default();
        let times = [due_ns, run_ns, sensor_ns].map(|ns| ns as u64);
        self.file.write([published, times[0], times[1], times[2]])
    }
}

/// Returns the schedule of the run's source, if it has written one: a replaced source need not.
pub fn read(manifest: &Manifest) -> Option<Schedule> {
    let [published, due_ns] = numbers::read(&manifest.root.join(FILE))?;
    Some(Schedule {
        published,
        due_ns: due_ns as i64,
    })
}

/// The name of the file in the run's root: one more than `Item::published` of the newest item that
/// was handed over.
const ELSEWHERE: &str = "elsewhere";

/// Begins without the other machine, which has not reported where it continues.
pub(crate) fn begin_elsewhere(manifest: &Manifest) -> Result<Numbers<1>, RunError> {
    let mut file = Numbers::open(manifest, ELSEWHERE)?;
    file.write([u64::MAX])?;
    Ok(file)
}

/// Returns whether stages on another machine owe the pose of an item that was handed over to them,
/// after so many poses.
pub fn owes(manifest: &Manifest, poses: u64) -> bool {
    numbers::read(&manifest.root.join(ELSEWHERE)).is_some_and(|[items]| items > poses)
}
