//! The progress of a follower, a file in the run's root. The supervisor reads it to learn whether
//! the follower has come to its end, which no exit code shows: a follower that was asked to end
//! exits as well.

use crate::{
    Manifest, StageError,
    numbers::{self, Numbers},
};

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Progress {
    pub done: u64,
    pub total: u64,
}

/// Writes [`Progress::done`], [`Progress::total`], and 1 at the end of the logs.
pub(super) struct ProgressWriter(Numbers<3>);

impl ProgressWriter {
    pub fn create(manifest: &Manifest, follower: &str) -> Result<Self, StageError> {
        Numbers::open(manifest, &file_of(follower), 0).map(Self)
    }

    pub fn write(&mut self, progress: Progress, has_ended: bool) -> Result<(), StageError> {
        let Progress { done, total } = progress;
        self.0.write([done, total, has_ended.into()])
    }
}

/// Returns the progress of a follower and whether it has come to its end; `None` before its first
/// step.
pub fn read(manifest: &Manifest, follower: &str) -> Option<(Progress, bool)> {
    let [done, total, ended] = numbers::read(&manifest.root.join(file_of(follower)), 0)?;
    Some((Progress { done, total }, ended == 1))
}

pub fn is_done(manifest: &Manifest, follower: &str) -> bool {
    read(manifest, follower).is_some_and(|(_, has_ended)| has_ended)
}

fn file_of(follower: &str) -> String {
    format!("{follower}.progress")
}
