//! All inter-process communication of Gyre. Only this crate depends on the transport (iceoryx2).
//!
//! Reading order: [`Manifest`], [`run`], [`launch`]; `transport`, [`writer`], [`reader`]; [`wake`];
//! the loops [`source`], [`stage`], [`sink`] and [`follower`]; [`observer`], [`relay`].
//!
//! The protocol: items carry consecutive sequence numbers. The source may have W of them in flight;
//! each pose is the credit for one more. A stage is a function of its inputs, and a publisher keeps
//! a history for late readers. So a restarted stage processes the history of its inputs again, and
//! its readers skip duplicates. A stage with state writes it to a file before it publishes; the
//! sink starts by publishing its last poses again.

// Shared memory, raw file descriptors and `pre_exec` need `unsafe`; each use states why it is
// sound.
#![allow(unsafe_code)]

pub mod clock;
pub mod control;
pub mod counters;
mod datagrams;
mod error;
pub mod follower;
mod generation;
mod gnss_receiver;
pub mod heartbeat;
pub mod inputs;
pub mod launch;
mod manifest;
pub mod message;
mod numbers;
pub mod observer;
pub mod python_function;
pub mod reader;
pub mod relay;
pub mod run;
pub mod schedule;
pub mod services;
pub mod sessions;
mod shared_memory;
pub mod sink;
pub mod source;
pub mod stage;
#[cfg(test)]
mod tests;
pub mod transport;
pub mod wake;
pub mod writer;

pub use counters::CountingAllocator;
pub use error::StageError;
pub use follower::Follower;
pub use generation::Generation;
pub use gnss_receiver::GnssReceiver;
pub use gyre_contract::run::StageCounters;
pub use launch::Launch;
pub use manifest::Manifest;
pub use sink::Sink;
pub use source::Source;
pub use stage::Stage;
pub use transport::Listener;
