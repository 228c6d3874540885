//! A running run, seen from a program outside: its topics, its status, and requests to its
//! supervisor.
//!
//! ```no_run
//! use gyre_client::Run;
//! use gyre_contract::Pose;
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! for pose in Run::open("out/robot")?.observe::<Pose>()? {
//!     println!("{:?}", pose?.pose());
//! }
//! # Ok(())
//! # }
//! ```
//!
//! | to | use |
//! |---|---|
//! | attach to a run by the folder of its results, or to the only one | [`Run::open`], [`Run::only`] |
//! | read a topic, typed | [`Run::observe`] |
//! | read a topic by its name | [`gyre_contract::topic`], [`Run::observe_topic`] |
//! | read its journal | [`RecordReader`] of [`PoseHeader`](gyre_contract::PoseHeader) |
//! | wait for several topics | [`Observer::next`], [`wait_for_any`] |
//! | restart, swap or end | [`control::Control`] |
//! | measure the processes | [`UsedRun`] |
//!
//! An observer changes neither a result nor a latency of the run. It may be slow, be stopped or be
//! killed: its queue then loses the oldest messages, and the observer counts those that it has
//! missed. A message is read in the memory of its publisher; an observer holds one at a time.

pub mod control;
mod last_line;
pub mod memory;
pub mod observer;
mod process_stat;
mod usage;

pub use gyre_storage::{RecordReader, free_bytes, has_room};
pub use gyre_transport::{
    AnyMessage, Listener, Manifest, RecordedMessage, RunError, clock, log,
    reader::Received,
    received, run, sessions,
    wake::{self, MAX_WAIT, Signals, let_signals_end_the_process, wait_for_readable},
    writer::TopicWriter,
};
pub use last_line::last_line;
pub use observer::{Message, Messages, Next, Observer, Run, TopicObserver, wait_for_any};
pub use process_stat::ProcessStat;
pub use usage::{Usage, UsedRun};
