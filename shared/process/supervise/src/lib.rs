//! Starts the processes of a run, restarts dead ones, and removes all resources at the end.
//!
//! After a death only the dead stage is restarted: every start resumes. All stages are restarted if
//! that does not help (the stage dies again before a new pose, or no pose is published) or if the
//! plan demands it. Followers are no part of that: they are restarted alone, and waited for at the
//! end. [`rig`] runs one process alone, to test it.
//!
//! Reading order: `supervisor`, the loop; its parts, each with a file of that name: `processes`,
//! `poses`, `stall`, `recovery`, `followers`, `swaps`, `recorder`; `restarts` and `requests`, the
//! actions that they decide; `start` and `child`, a process; `clean`. [`ProcessStat`], [`Usage`]
//! and [`memory`] read `/proc`.

// `pre_exec` and raw file descriptors need `unsafe`; each use states why it is sound.
#![allow(unsafe_code)]

mod child;
mod clean;
mod death;
mod end;
mod followers;
mod guardian;
mod log;
pub mod memory;
mod observers;
mod plan;
mod poses;
mod process_stat;
mod process_status;
mod processes;
mod program;
mod recorder;
mod recovery;
mod requests;
mod restarts;
pub mod rig;
mod roles;
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

pub use death::Death;
pub use guardian::guard;
pub use gyre_run::{Ending, Scheduling, Swapped};
pub use log::last_line;
pub use plan::{END_TIMEOUT, Event, Plan, StagePlan, Stall, SuperviseError};
pub use process_stat::ProcessStat;
pub use program::Program;
pub use requests::wait;
pub use supervisor::supervise;
pub use usage::{Usage, UsedRun};
