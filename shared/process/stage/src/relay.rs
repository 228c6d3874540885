//! Stand-ins for the stages of a run that work on another machine, in a run that is split between
//! two.
//!
//! [`LastStages`] reads the topics that those read and publishes what comes back from them.
//! [`FirstStages`] publishes, in the place of the source, the topics that those publish. Both have
//! the places of the stages that they stand for, so they miss nothing; how the messages get from
//! one machine to the other is not known here.

mod first;
mod last;

pub use first::FirstStages;
pub use last::LastStages;
