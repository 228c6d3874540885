//! A running run seen from outside: its topics, its status, and requests to its supervisor.

pub mod control;
mod last_line;
pub mod memory;
pub mod observer;
mod process_stat;
mod usage;

pub use gyre_transport::{
    AnyMessage, Listener, Manifest, RecordedMessage, RunError, clock, log, reader::Received,
    received, run, sessions, wake, writer::TopicWriter,
};
pub use last_line::last_line;
pub use process_stat::ProcessStat;
pub use usage::{Usage, UsedRun};
