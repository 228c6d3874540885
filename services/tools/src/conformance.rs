//! Programs in the place of a stage: does one keep the contract of a stage, which is in
//! `docs/replace-a-stage.md`, and how do its results differ from the results of a running stage?
//!
//! The program runs alone, in runs of its own, as the supervisor would start it. This process
//! replaces the rest of such a run (`harness`): it feeds the program, and judges the program's
//! messages. For [`check`] the inputs are the results of Gyre's own stages for some scans, for
//! [`shadow`](mod@shadow) the items of a running run.

mod checks;
mod harness;
mod item;
mod malformed;
mod reference;
mod report;
mod result;
mod rule;
mod session;
pub mod shadow;

use std::{io, path::Path, time::Duration};

use gyre_client::{RunError, Signals};
use gyre_configuration::terminal::Failure;
use gyre_contract::StageId;
use gyre_supervise::{SuperviseError, rig::Rig};

pub use harness::Candidate;
pub use report::{Report, Work};
pub use result::{Spread, Spreads};
pub use rule::{Rule, Verdict};

use checks::Examination;
use reference::{Context, Reference};

/// Writes the other files of a run's root, as the list of a recording's files.
type Prepare = Box<dyn Fn(&Path) -> io::Result<()>>;

/// A program that is to keep the contract of a stage, and its limits.
pub struct Test {
    /// The program. Each of its runs writes to a folder below its manifest's `out`.
    pub candidate: Candidate,
    pub stages: Vec<StageId>,
    pub prepare: Prepare,
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
        (self.prepare)(root).map_err(RunError::file(root))?;
        Ok(rig)
    }
}

/// Tests a program; `observe` receives the name of each scenario.
/// Breaches of the contract are in the report, not in the error. A signal ends the test with
/// [`RunError::Stopped`].
pub fn check(
    test: &Test,
    signals: &Signals,
    observe: &mut dyn FnMut(&str),
) -> Result<Report, Failure> {
    observe("the inputs, by our own stages");
    let reference = Reference::compute(test, signals)?;
    let context = Context {
        test,
        reference: &reference,
        signals,
    };
    Examination::new(context, observe).run()
}
