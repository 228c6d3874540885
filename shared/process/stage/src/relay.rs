//! Stand-ins for the stages of a run that work on another machine, in a run that is split between
//! two.
//!
//! [`LastStages`] reads the topics of the last stages and publishes the messages that come back
//! from them. [`FirstStages`] publishes, in the place of the source, the topics of the first
//! stages. Both have the places of the stages that they stand for, so they miss nothing; how the
//! messages get from one machine to the other is not known here.

mod first;
mod last;

pub use first::FirstStages;
pub use last::LastStages;
