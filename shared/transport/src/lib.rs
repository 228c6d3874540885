//! The transport of a run: its files in shared memory, its topics, and what wakes its processes.
//! Only this crate depends on iceoryx2.
//!
//! Reading order: [`Manifest`], [`run`]; `transport`, [`writer`], [`reader`]; [`wake`].

// Shared memory and raw file descriptors need `unsafe`; each use states why it is sound.
#![allow(unsafe_code)]

pub mod clock;
mod error;
pub mod generation;
pub mod heartbeat;
pub mod log;
mod manifest;
mod message;
pub mod numbers;
pub mod reader;
pub mod received;
#[cfg(any(test, feature = "rig"))]
pub mod rig;
pub mod run;
pub mod services;
pub mod sessions;
mod shared_memory;
#[cfg(test)]
mod tests;
pub mod transport;
pub mod wake;
pub mod writer;

pub use error::RunError;
pub use generation::Generation;
pub use manifest::Manifest;
pub use message::{AnyMessage, RecordedMessage};
pub use transport::Listener;
