//! Refines the motions that the search found. For now it passes them through.

mod config;

use gyre_messages::{Masked, Motion, Refined};
use gyre_stage::{
    Launch, Stage, StageError, Statistics,
    inputs::{Joined, JoinedView},
    stage,
    writer::Draft,
};

pub use config::{RefinementConfig, RefinementKind};

/// The stage's name.
pub const NAME: &str = "refinement";

/// Runs the stage until it is told to stop.
pub fn run(launch: &Launch) -> Result<Statistics, StageError> {
    stage::run(launch, &mut PassThrough)
}

struct PassThrough;

impl Stage for PassThrough {
    type Inputs = Joined<Masked, Motion>;
    type Output = Refined;
    const HOP: gyre_messages::Stage = gyre_messages::Stage::Refinement;

    fn process(
        &mut self,
        input: JoinedView<'_, Masked, Motion>,
        output: &mut Draft<Refined>,
    ) -> Result<(), StageError> {
        output.header().motion = input.other.header().motion;
        Ok(())
    }
}
