//! Checks whether a program keeps the contract of a stage, which is in `docs/replace-a-stage.md`.
//!
//! The program runs alone, in runs of its own, as the supervisor would start it. This process
//! stands for the rest of such a run ([`gyre_harness`]): it feeds the program the results of Gyre's
//! own stages for some scans, and examines what it sends.
//!
//! Reading order: [`Rule`] (what is checked), [`check`], `checks` (the scenarios), `session` (one
//! process under test), `reference` (the inputs), `malformed` (inputs that must be refused).

mod checks;
mod context;
mod deviation;
mod error;
mod malformed;
mod reference;
mod report;
mod rule;
mod session;
mod test;

use gyre_stage::wake::Signals;

pub use error::ConformanceError;
pub use gyre_harness::Candidate;
pub use report::{Report, Work};
pub use rule::{Rule, Verdict};
pub use test::{Demands, InputScans, Prepare, Test};

use checks::Examination;
use context::Context;
use reference::Reference;

/// Tests a program with inputs from these scans; `observe` receives what is tested.
///
/// # Errors
/// The inputs cannot be computed, the program cannot be started, or the transport fails. A program
/// that breaks the contract is no error: the report says so.
pub fn check(
    test: &Test,
    mut scans: InputScans,
    signals: &Signals,
    observe: &mut dyn FnMut(&str),
) -> Result<Report, ConformanceError> {
    observe("the inputs, by our own stages");
    let reference = Reference::compute(test, &mut scans, signals)?;
    let context = Context {
        test,
        reference: &reference,
        signals,
    };
    Examination::new(context, observe).run()
}
