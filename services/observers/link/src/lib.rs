//! The topics of a run on another machine, over [zenoh](https://zenoh.io): a run that is split
//! between two machines (`robot` has the first stages and `base` the last ones), and a copy of a
//! run (`send` observes a run, `receive` publishes the messages that arrive as a run of its own).
//!
//! The receiver asks: a request names a topic and the first message that is wanted (`fetch`), and
//! is answered by that message and all that follow, as they come (`serve`). After a cut the
//! receiver asks again from where it is. So a message that is still there (`replay_buffer`) is
//! neither lost nor doubled, and the sender keeps no state of a receiver.

mod network;

#[cfg(feature = "zenoh")]
mod base;
#[cfg(feature = "zenoh")]
mod connection_log;
#[cfg(feature = "zenoh")]
mod error;
#[cfg(feature = "zenoh")]
mod fetch;
#[cfg(feature = "zenoh")]
mod handshake;
#[cfg(feature = "zenoh")]
mod patience;
#[cfg(feature = "zenoh")]
mod receive;
#[cfg(feature = "zenoh")]
mod replay_buffer;
#[cfg(feature = "zenoh")]
mod request;
#[cfg(feature = "zenoh")]
mod robot;
#[cfg(feature = "zenoh")]
mod send;
#[cfg(feature = "zenoh")]
mod serve;
#[cfg(feature = "zenoh")]
mod session;
#[cfg(all(test, feature = "zenoh"))]
mod tests;
#[cfg(feature = "zenoh")]
mod waker;

pub use network::{ONE_THREAD, check};

#[cfg(feature = "zenoh")]
pub use {
    base::run as run_base,
    handshake::ask_robot,
    receive::{Received, ask, receive},
    robot::run as run_robot,
    send::{Sent, send},
};
