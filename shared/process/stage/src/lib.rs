//! The loops of a run's processes: credit, history and life cycle, on the topics of
//! [`gyre_transport`].
//!
//! Reading order: [`launch`]; the loops [`source`], [`stage`], [`sink`] and [`follower`];
//! [`relay`].
//!
//! The protocol: items carry consecutive sequence numbers. The source may have W of them in flight;
//! each pose is the credit for one more. A stage is a function of its inputs, and a publisher keeps
//! a history for late readers. So a restarted stage processes the history of its inputs again, and
//! its readers skip duplicates. A stage with state writes it to a file before it publishes; the
//! sink starts by publishing its last poses again.

// An allocator that counts and raw file descriptors need `unsafe`; each use states why it is sound.
#![allow(unsafe_code)]

pub mod counters;
pub mod datagrams;
pub mod follower;
pub mod inputs;
pub mod launch;
pub mod python_function;
pub mod relay;
pub mod schedule;
pub mod sink;
pub mod source;
pub mod stage;

pub use counters::CountingAllocator;
pub use follower::Follower;
pub use gyre_transport::RunError;
pub use launch::Launch;
pub use sink::Sink;
pub use source::Source;
pub use stage::Stage;
