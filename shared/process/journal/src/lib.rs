//! The files for resuming a run after a death or a power failure: the journal of its poses; with
//! SLAM its [`keyframes`]; with objects its [`scans`], and the [`objects`] in each; and the
//! [`checkpoint`] of its refinement.
//!
//! The journal has each pose with its motion, written before the pose is published; all results of
//! a run are made from it. After a death or a power failure [`check`] finds the last whole pose;
//! the run computes the lost poses again.

pub mod checkpoint;
pub mod keyframes;
pub mod loops;
pub mod objects;
pub mod scans;
#[cfg(test)]
mod tests;

use std::{
    collections::VecDeque,
    path::{Path, PathBuf},
};

use gyre_contract::{Command, PoseHeader, flag};
use gyre_geometry::SparsePoint;
use gyre_storage::{GroupSync, LogError, RecordLog, RecordReader, records_path};

pub use gyre_storage::continue_when_full;

/// Number of the last poses that a check returns: more than a power failure can take.
const LAST: usize = 8 * GroupSync::LIMIT as usize;

#[derive(Debug)]
pub struct Journal(RecordLog<PoseHeader>);

/// A log of poses with the points of their scans, each appended before its pose is journalled.
pub trait PoseLog {
    /// Takes the next pose, before it is journalled. Returns whether it was appended.
    fn add(&mut self, pose: &PoseHeader, points: &[SparsePoint]) -> Result<bool, LogError>;

    /// Applies a command from the next pose on.
    fn obey(&mut self, _command: &Command) -> Result<(), LogError> {
        Ok(())
    }

    /// Marks the end of the stream, before the journal does. All records survive a power failure
    /// when this returns.
    fn end(&mut self) -> Result<(), LogError>;

    /// Waits until all records so far survive a power failure.
    fn sync(&self) -> Result<(), LogError>;
}

pub fn path(out: &Path) -> PathBuf {
    records_path::<PoseHeader>(out)
}

/// Reads the poses of a run, oldest first, and the end of the stream; none without a journal.
pub fn poses(
    out: &Path,
) -> Result<impl Iterator<Item = Result<PoseHeader, LogError>> + use<>, LogError> {
    poses_from(out, 0)
}

/// As [`poses`], from the pose number `first` on.
pub fn poses_from(
    out: &Path,
    first: u64,
) -> Result<impl Iterator<Item = Result<PoseHeader, LogError>> + use<>, LogError> {
    let first = usize::try_from(first).unwrap_or(usize::MAX);
    Ok(RecordReader::<PoseHeader>::open(out)?.from(first))
}

impl Journal {
    /// Opens or creates the journal of the run that writes to `out`, and cuts off last records that
    /// a death or a power failure has left incomplete. Only the end is read, however long it is.
    pub fn open(out: &Path) -> Result<Self, LogError> {
        let mut log = RecordLog::open(out)?;
        log.reserve(size_of::<PoseHeader>());
        Ok(Self(log))
    }

    /// Returns the last poses, at most `count`, oldest first, and whether the end of the stream
    /// follows them.
    pub fn last(&mut self, count: usize) -> Result<(Vec<PoseHeader>, bool), LogError> {
        let mut poses = Vec::with_capacity(count);
        let mut ended = false;
        for index in (0..self.0.len()).rev() {
            if poses.len() == count {
                break;
            }
            let pose = self.0.read(index)?;
            match pose.item.is(flag::END) {
                true => ended = true,
                false => poses.push(pose),
            }
        }
        poses.reverse();
        Ok((poses, ended))
    }

    /// Appends a pose, or the end of the stream.
    pub fn append(&mut self, pose: &PoseHeader) -> Result<(), LogError> {
        self.0.append(pose)
    }

    /// Waits until all that was appended survives a power failure.
    pub fn sync(&self) -> Result<(), LogError> {
        self.0.sync()
    }
}

#[derive(Clone, Debug, Default)]
pub struct Content {
    pub poses: u64,
    /// True if the end of the stream follows them.
    pub ended: bool,
    /// Records behind them that are not whole, or that follow the end: to be cut off by [`cut`].
    pub torn: u64,
    /// The last poses, oldest first; not all of them in a long journal.
    pub last: VecDeque<PoseHeader>,
}

/// Reads a whole journal, in bounded memory, and finds out what of it is valid. Changes nothing.
pub fn check(out: &Path) -> Result<Content, LogError> {
    let mut reader = RecordReader::<PoseHeader>::open(out)?;
    let mut content = Content::default();
    for index in 0..reader.len() {
        let pose = reader.read(index)?;
        if content.ended {
            content.torn += 1;
            continue;
        }
        content.ended = pose.item.is(flag::END);
        if !content.ended {
            content.poses += 1;
            if content.last.len() == LAST {
                content.last.pop_front();
            }
            content.last.push_back(pose);
        }
    }
    content.torn += reader.torn() as u64;
    Ok(content)
}

/// Cuts a journal after `records` records. The cut survives a power failure. Waits up to a second
/// for a stage of a killed run that still writes it: that dies a moment after its supervisor.
pub fn cut(out: &Path, records: u64) -> Result<(), LogError> {
    let mut log = RecordLog::<PoseHeader>::open(out)?;
    log.cut(usize::try_from(records).unwrap_or(usize::MAX))
}
