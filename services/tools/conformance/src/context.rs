//! The test with its inputs, as all checks need it.

use gyre_stage::wake::Signals;

use crate::{reference::Reference, test::Test};

/// The test with its inputs.
#[derive(Clone, Copy)]
pub(crate) struct Context<'a> {
    pub test: &'a Test,
    pub reference: &'a Reference,
    pub signals: &'a Signals,
}
