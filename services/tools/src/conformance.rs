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
mod test;
mod topics;

use std::{io, path::Path};

use gyre_stage::{StageError, wake::Signals};
use gyre_terminal::Failure;
use thiserror::Error;

pub use harness::Candidate;
pub use report::{Report, Work};
pub use result::{Spread, Spreads};
pub use rule::{Rule, Verdict};
pub use test::{Demands, InputScans, Prepare, Test};

use checks::Examination;
use reference::{Context, Reference};

/// The end of a test by a signal.
#[derive(Debug, Error)]
#[error("interrupted")]
pub struct Interrupted;

/// Tests a program with inputs from these scans; `observe` receives the name of each scenario.
/// Breaches of the contract are in the report, not in the error.
pub fn check(
    test: &Test,
    mut scans: InputScans,
    signals: &Signals,
    observe: &mut dyn FnMut(&str),
) -> Result<Report, Failure> {
    observe("the inputs, by our own stages");
    let reference = Reference::compute(test, &mut scans, signals)?;
    let context = Context {
        test,
        reference: &reference,
        signals,
    };
    Examination::new(context, observe).run()
}

/// Returns a function that names the file of a system error.
fn at(path: &Path) -> impl FnOnce(io::Error) -> StageError + use<> {
    let path = path.to_owned();
    move |source| StageError::File { path, source }
}
