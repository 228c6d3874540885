//! The topics of a run on another machine, over [zenoh](https://zenoh.io).
//!
//! Two things are built on it: a run that is split between two machines (`robot` has the first stages and `base` the last ones), and
//! looking on from another machine (`send` observes a run, `receive` publishes what comes as a run of its own).
//!
//! The receiver asks: a request names a topic and the first message that is wanted, and is answered by that message and all that
//! follow, as they come. After a cut it asks again from where it is. So a message that is still there is neither lost nor doubled, and
//! the sender keeps no state of a receiver. What is still there depends on the topic: see `tape`.
//!
//! Reading order: [`config`], `network` (who may connect, and how), `tape` (what is kept to be sent), `serve` and `fetch` (the two ends of
//! a topic), then `robot` and `base`, then `send` and `receive`.

pub mod config;
mod network;

#[cfg(feature = "zenoh")]
mod base;
#[cfg(feature = "zenoh")]
mod begin;
#[cfg(feature = "zenoh")]
mod error;
#[cfg(feature = "zenoh")]
mod fetch;
#[cfg(feature = "zenoh")]
mod observing;
#[cfg(feature = "zenoh")]
mod receive;
#[cfg(feature = "zenoh")]
mod robot;
#[cfg(feature = "zenoh")]
mod send;
#[cfg(feature = "zenoh")]
mod serve;
#[cfg(feature = "zenoh")]
mod status;
#[cfg(feature = "zenoh")]
mod tape;
#[cfg(all(test, feature = "zenoh"))]
mod tests;
#[cfg(feature = "zenoh")]
mod wake;

pub use config::{LinkConfig, Side};
pub use network::{Network, NetworkError, ONE_THREAD};

#[cfg(feature = "zenoh")]
pub use base::run as run_base;
#[cfg(feature = "zenoh")]
pub use begin::{Scans, ask_robot};
#[cfg(feature = "zenoh")]
pub use error::LinkError;
#[cfg(feature = "zenoh")]
pub use receive::{ReceiveOptions, Received, ask, receive};
#[cfg(feature = "zenoh")]
pub use robot::run as run_robot;
#[cfg(feature = "zenoh")]
pub use send::{SendOptions, Sent, send};
