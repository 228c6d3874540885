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
mod malformed;
mod reference;
mod report;
mod rule;
mod session;
mod test;

use gyre_stage::{StageError, wake::Signals};
use gyre_supervise::SuperviseError;
use thiserror::Error;

pub use gyre_harness::Candidate;
pub use report::{Report, Work};
pub use rule::{Rule, Verdict};
pub use test::{Demands, InputScans, Prepare, Test};

use checks::Examination;
use context::Context;
use reference::Reference;

/// Why a program could not be tested.
#[derive(Debug, Error)]
pub enum ConformanceError {
    /// A process or the transport.
    #[error(transparent)]
    Supervise(#[from] SuperviseError),
    /// The inputs cannot be computed.
    #[error("cannot compute the inputs: our own {stage} ended: {reason}")]
    Own {
        /// The stage.
        stage: &'static str,
        /// The reason.
        reason: String,
    },
    /// Too few scans.
    #[error(
        "{0} scans are too few to test a stage with: name a recording of more, or raise --scans"
    )]
    TooFew(usize),
    /// A signal asked for the end.
    #[error("interrupted")]
    Interrupted,
}

impl From<StageError> for ConformanceError {
    fn from(error: StageError) -> Self {
        Self::Supervise(error.into())
    }
}

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
