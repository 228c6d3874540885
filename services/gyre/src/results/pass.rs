//! One pass over the journal.

use gyre_messages::{Item, PoseHeader, flag};
use gyre_radar::ground_truth::write_tum_pose;
use gyre_storage::Draft;

use super::{Estimate, Files, Sketch};
use crate::{Failure, latency::LatencyMeter, odometry, summary::Counter};

/// Writes the tables row by row, and measures and counts all else.
#[derive(Debug)]
pub struct Pass<'a, 'b> {
    files: &'a mut Files<'b>,
    odometry: Draft,
    tum: Draft,
    row: String,
    /// Poses of earlier sessions that are still to come.
    resumed: usize,
    is_judged: bool,
    read: Read,
}

/// What was read.
#[derive(Debug, Default)]
pub struct Read {
    /// The end of the stream, if it came to that.
    pub end: Option<Item>,
    /// The poses of all sessions.
    pub counter: Counter,
    /// Those of this session: earlier ones may be of another boot, whose clock is another one.
    pub latency: LatencyMeter,
    /// The path to be drawn.
    pub sketch: Sketch,
    /// The poses to be evaluated.
    pub estimate: Estimate,
}

impl<'a, 'b> Pass<'a, 'b> {
    /// Starts with a journal of which `resumed` poses are of earlier sessions. Poses are kept if they are to be judged.
    ///
    /// # Errors
    /// A file that cannot be created.
    pub fn new(files: &'a mut Files<'b>, resumed: usize, is_judged: bool) -> Result<Self, Failure> {
        let (mut odometry, tum) = (
            files.create("odometry.csv")?,
            files.create("trajectory.tum")?,
        );
        odometry.append(odometry::HEADER)?;
        Ok(Self {
            files,
            odometry,
            tum,
            row: String::new(),
            resumed,
            is_judged,
            read: Read::default(),
        })
    }

    /// Adds the next record.
    ///
    /// # Errors
    /// A file that cannot be written.
    pub fn add(&mut self, pose: &PoseHeader) -> Result<(), Failure> {
        if pose.item.is(flag::END) {
            self.read.end = Some(pose.item);
            return Ok(());
        }
        self.row.clear();
        odometry::write_row(pose, &mut self.row);
        self.odometry.append(&self.row)?;
        let place = pose.pose().motion;
        let mut line = Vec::new();
        write_tum_pose(pose.item.stamp_ns, &place, &mut line)?;
        self.tum.append(line)?;
        self.read.counter.add(pose);
        self.read.sketch.add(place);
        match self.resumed.checked_sub(1) {
            Some(left) => self.resumed = left,
            None => self.read.latency.add(pose),
        }
        if self.is_judged {
            self.read.estimate.add(pose);
        }
        Ok(())
    }

    /// Returns what was read.
    pub fn finish(self) -> Read {
        self.files.push(self.odometry);
        self.files.push(self.tum);
        self.read
    }
}
