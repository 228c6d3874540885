//! Starts the processes of a run, restarts dead ones, and removes all resources at the end. A dead
//! stage is restarted alone, since every start resumes; all are, if that does not help or the plan
//! demands it. Followers are restarted alone. [`rig`] runs one process alone, to test it.
//!
//! Reading order: `supervisor`, the loop; its parts `processes`, `poses`, `stall`, `recovery`,
//! `followers`, `swaps`, `recorder`; `restarts` and `requests`, which carry out their decisions;
//! `start` and `child`, a process; `clean`.

// `pre_exec` and raw file descriptors need `unsafe`; each use states why it is sound.
#![allow(unsafe_code)]

mod child;
mod clean;
mod end;
mod followers;
mod guardian;
mod log;
mod plan;
mod poses;
mod processes;
mod program;
mod recorder;
mod recovery;
mod requests;
mod restarts;
pub mod rig;
mod run;
mod scheduling;
mod socket;
mod stall;
mod start;
mod supervisor;
mod swaps;
#[cfg(test)]
mod tests;
mod wake_limit;

pub use child::Death;
pub use guardian::guard;
pub use gyre_contract::run::{Ending, Scheduling, Swapped};
pub use plan::{END_TIMEOUT, Event, Plan, StagePlan, Stall, SuperviseError};
pub use program::Program;
pub use requests::wait;
pub use supervisor::supervise;
