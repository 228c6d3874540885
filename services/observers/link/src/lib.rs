//! The topics of a run on another machine, over [zenoh](https://zenoh.io): a run that is split
//! between two machines (`robot` has the first stages and `base` the last ones), and a copy of a
//! run (`send` observes a run, `receive` publishes the messages that arrive as a run of its own).
//!
//! The receiver asks: a request names a topic and the first message that is wanted (`fetch`), and
//! is answered by that message and all that follow, as they come (`serve`). After a cut the
//! receiver asks again from where it is. So a message that is still there (`replay_buffer`) is
//! neither lost nor doubled, and the sender keeps no state of a receiver.

#![cfg(feature = "zenoh")]

mod base;
mod connection_log;
mod error;
mod fetch;
mod handshake;
mod network;
mod patience;
mod receive;
mod replay_buffer;
mod request;
mod robot;
mod send;
mod serve;
mod session;
#[cfg(test)]
mod tests;
mod waker;

pub use {
    base::run as run_base,
    handshake::ask_robot,
    network::{ONE_THREAD, check},
    receive::{Received, ask, receive},
    robot::run as run_robot,
    send::{Sent, send},
};
