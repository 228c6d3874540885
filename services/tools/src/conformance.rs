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

use gyre_stage::wake::Signals;
use gyre_terminal::Failure;

pub use harness::Candidate;
pub use report::{Report, Work};
pub use result::{Spread, Spreads};
pub use rule::{Rule, Verdict};
pub use test::{Demands, Test};

use checks::Examination;
use reference::{Context, Reference};

/// Tests a program; `observe` receives the name of each scenario.
/// Breaches of the contract are in the report, not in the error. A signal ends the test with
/// [`StageError::Stopped`](gyre_stage::StageError).
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
