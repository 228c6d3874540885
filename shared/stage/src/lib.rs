//! All of Gyre's inter-process communication. Only this crate and the wire types know the transport.
//!
//! Reading order:
//!
//! 1. [`run`]: what a process reads of its run, and where a run's files lie.
//! 2. [`launch`]: how a process starts and ends: configuration, log, signals, exit codes.
//! 3. [`writer`], [`reader`]: the two ends of a topic, with the handshake that gives a new reader the history.
//! 4. [`wake`]: how a process sleeps until there is something to do.
//! 5. [`source`], [`stage`], [`sink`]: the loops of the first, the middle and the last process; [`inputs`] says what a
//!    middle one waits for.
//! 6. [`supervise`]: starts the processes, restarts those that die, leaves nothing behind.
//!
//! The protocol in one paragraph: items carry consecutive numbers. The source may have W of them in flight; a pose is the
//! credit for one more. A stage is a function of its inputs, and a publisher keeps the last few items for readers that come
//! later, so a restarted stage processes its upstream's history again and its readers skip what they have had. A stage that
//! owns state writes it to a file before it publishes; the sink starts by publishing its last poses again.

// Mapping shared memory, borrowing raw descriptors and preparing a child process need `unsafe`; each use gives its reason.
#![allow(unsafe_code)]

mod allocations;
pub mod clock;
mod counters;
mod error;
pub mod inputs;
pub mod launch;
pub mod reader;
pub mod run;
mod services;
pub mod sink;
pub mod source;
pub mod stage;
pub mod supervise;
#[cfg(test)]
mod tests;
pub mod wake;
pub mod writer;

pub use allocations::CountingAllocator;
pub use counters::StageCounters;
pub use error::StageError;
pub use launch::Launch;
pub use run::Manifest;
pub use services::Listener;
pub use sink::Sink;
pub use source::Source;
pub use stage::Stage;
