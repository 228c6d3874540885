//! The loops in the logs of a run, as they are published: for programs that must have all of them,
//! whenever they come.

use std::path::Path;

use gyre_contract::{Item, LoopHeader};
use gyre_geometry::{covariance, xy_yaw};
use gyre_slam::{Keyframe, LoopCandidate, Query};
use gyre_storage::{LogError, RecordReader};

pub struct LoggedLoops {
    keyframes: RecordReader<Keyframe>,
    queries: RecordReader<Query>,
    /// Number of queries whose loops are in `loops`.
    read: usize,
    loops: Vec<LoopHeader>,
}

impl LoggedLoops {
    pub fn open(out: &Path) -> Result<Self, LogError> {
        Ok(Self {
            keyframes: RecordReader::open(out)?,
            queries: RecordReader::open(out)?,
            read: 0,
            loops: Vec::new(),
        })
    }

    /// Reads new records since the last call, and returns all loops so far, by their numbers.
    pub fn refresh(&mut self) -> Result<&[LoopHeader], LogError> {
        self.queries.refresh()?;
        self.keyframes.refresh()?;
        if self.queries.unchanged() < self.read {
            self.loops.clear();
            self.read = 0;
        }
        while self.read < self.queries.len() {
            let query = self.queries.read(self.read)?;
            let found = loops_of(&query, self.loops.len() as u64, &mut self.keyframes)?;
            self.loops.extend(found);
            self.read += 1;
        }
        Ok(&self.loops)
    }
}

/// Returns the messages of the loops of a query, numbered from `first` on.
pub fn loops_of(
    query: &Query,
    first: u64,
    keyframes: &mut RecordReader<Keyframe>,
) -> Result<Vec<LoopHeader>, LogError> {
    let mut found = Vec::new();
    for (number, (candidate, _)) in (first..).zip(query.loops()) {
        let ends = [query.keyframe, candidate.place];
        let [later, earlier] = ends.map(|index| Keyframe::without_points(keyframes, index));
        found.push(loop_header(number, &later?, &earlier?, candidate));
    }
    Ok(found)
}

/// Returns the message of the loop with the number `loops`, which closes `candidate`.
fn loop_header(
    loops: u64,
    later: &Keyframe,
    earlier: &Keyframe,
    candidate: &LoopCandidate,
) -> LoopHeader {
    let [x_m, y_m, yaw_rad] = xy_yaw(&candidate.motion.motion);
    LoopHeader {
        item: Item {
            seq: loops,
            scan: later.scan,
            previous_scan: earlier.scan,
            stamp_ns: later.stamp_ns,
            ..Item::default()
        },
        later_seq: later.seq,
        earlier_seq: earlier.seq,
        x_m,
        y_m,
        yaw_rad,
        covariance: covariance::pack(&candidate.motion.covariance),
        correlation: candidate.correlation,
        loops: loops + 1,
    }
}
