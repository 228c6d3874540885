//! All of Gyre's inter-process communication. Nothing else touches the transport.
//!
//! Reading order:
//!
//! 1. [`run`]: what a process learns of its run, and where a run's files lie.
//! 2. [`launch`]: how a process starts and ends: configuration, log, signals, exit codes.
//! 3. [`writer`], [`reader`]: the two ends of a topic, with the greeting that hands the history to a newcomer.
//! 4. [`wake`]: how a process sleeps until there is something to do.
//! 5. [`source`], [`stage`], [`sink`]: the loops of the first, the middle and the last process;
//!    [`inputs`] and [`scans`] say what a middle one waits for.
//! 6. [`supervise`]: starts the processes, repairs the run when one dies, leaves nothing behind.
//!
//! The protocol in one paragraph: items carry consecutive numbers. The source may have W of them on their way; a pose is
//! the credit for one more. A stage is a function of its inputs, and a publisher keeps the last few items for readers that
//! come later, so a restarted stage works through its upstream's history anew and its readers skip what they have had. Only
//! the sink owns state: it journals before it publishes, and starts by publishing its last poses again.

// Mapping shared memory, borrowing raw descriptors and preparing a child process need `unsafe`; each use says why it holds.
#![allow(unsafe_code)]

mod allocations;
pub mod clock;
mod error;
mod feedback;
pub mod inputs;
pub mod launch;
pub mod reader;
pub mod run;
pub mod scans;
mod services;
pub mod sink;
pub mod source;
pub mod stage;
mod statistics;
pub mod supervise;
#[cfg(test)]
mod tests;
pub mod wake;
pub mod writer;

pub use error::StageError;
pub use launch::Launch;
pub use run::Manifest;
pub use sink::Sink;
pub use source::Source;
pub use stage::Stage;
pub use statistics::Statistics;
