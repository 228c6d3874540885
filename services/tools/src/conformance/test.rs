//! The program that is tested, and its limits.

use std::{io, path::Path, time::Duration};

use gyre_messages::StageId;
use gyre_stage::{StageError, wake::Signals};
use gyre_supervise::{SuperviseError, rig::Rig};

use crate::conformance::Candidate;

/// A program that is to keep the contract of a stage, and its limits.
pub struct Test {
    /// The program. Each of its runs writes to a folder below its manifest's `out`.
    pub candidate: Candidate,
    pub stages: Vec<StageId>,
    /// Writes the other files of a run's root, as the list of a recording's files.
    pub prepare: Box<dyn Fn(&Path) -> io::Result<()>>,
    pub demands: Demands,
}

#[derive(Clone, Debug)]
pub struct Demands {
    pub start_timeout: Duration,
    pub item_timeout: Duration,
    /// Time for its exit after SIGTERM, and after an input that it has to refuse.
    pub stop_timeout: Duration,
    /// True if its results must equal the results of Gyre's own stage, to the bit.
    pub same_as_own: bool,
    /// The 99th percentile of its work on an item that is allowed; of fewer than a hundred items
    /// the maximum.
    pub budget: Option<Duration>,
}

impl Test {
    pub(crate) fn rig<'a>(
        &self,
        name: &str,
        signals: &'a Signals,
    ) -> Result<Rig<'a>, SuperviseError> {
        let out = self.candidate.manifest.out.join(name);
        let rig = self.candidate.rig(out, signals)?;
        let root = &rig.manifest().root;
        (self.prepare)(root).map_err(StageError::file(root))?;
        Ok(rig)
    }
}
