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
pub mod memory;
mod plan;
mod poses;
mod process_stat;
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
mod usage;
mod wake_limit;

pub use child::Death;
pub use guardian::guard;
pub use gyre_contract::run::{Ending, Scheduling, Swapped};
pub use log::last_line;
pub use plan::{END_TIMEOUT, Event, Plan, StagePlan, Stall, SuperviseError};
pub use process_stat::ProcessStat;
pub use program::Program;
pub use requests::wait;
pub use supervisor::supervise;
pub use usage::{Usage, UsedRun};
