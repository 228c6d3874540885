//! The loops in the logs of a run, as they are published: for programs that must have all of them,
//! whenever they come.

use std::path::Path;

use gyre_messages::LoopHeader;
use gyre_slam::{Keyframe, Query, RecordReader};
use gyre_stage::StageError;

use crate::header;

/// The loops of a run so far.
pub struct LoggedLoops {
    keyframes: RecordReader<Keyframe>,
    queries: RecordReader<Query>,
    /// Number of queries whose loops are in `loops`.
    read: usize,
    loops: Vec<LoopHeader>,
}

impl LoggedLoops {
    /// Opens the logs of the run that writes to `out`.
    pub fn open(out: &Path) -> Result<Self, StageError> {
        Ok(Self {
            keyframes: RecordReader::open(out)?,
            queries: RecordReader::open(out)?,
            read: 0,
            loops: Vec::new(),
        })
    }

    /// Reads new records of the log, and returns all loops so far, by their numbers.
    pub fn refresh(&mut self) -> Result<&[LoopHeader], StageError> {
        self.queries.refresh()?;
        self.keyframes.refresh()?;
        if self.queries.unchanged() < self.read {
            self.loops.clear();
            self.read = 0;
        }
        while self.read < self.queries.len() {
            let query = self.queries.read(self.read)?;
            for (candidate, _) in query.loops() {
                let ends = [query.keyframe, candidate.place];
                let [later, earlier] = ends.map(|index| self.keyframes.read_without_points(index));
                let loops = self.loops.len() as u64;
                self.loops
                    .push(header(loops, &later?, &earlier?, candidate));
            }
            self.read += 1;
        }
        Ok(&self.loops)
    }
}
