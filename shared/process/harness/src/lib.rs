//! A program alone in the place of a stage: `gyre conformance` and `gyre shadow` share this.
//!
//! - [`Candidate`]: the program and the run that it sees; [`Harness`]: its process in a run of its
//!   own, with the publishers of its inputs and the reader of its output;
//! - [`StageTopics`]: the topics of each stage;
//! - [`item`]: the fields that an item copies from its input, and the stamps of its own hop;
//! - [`result`]: the bytes of a message that are a result, and the difference of two results.

mod candidate;
mod harness;
pub mod item;
pub mod result;
mod topics;

pub use candidate::Candidate;
pub use gyre_supervise::{
    Death, Scheduling, SuperviseError,
    rig::{Feed, Process, Recorded, Rig, Tap},
};
pub use harness::{Harness, Sent, start_of_trajectory};
pub use topics::{Direction, StageTopics};
