//! The topics of a run for Foxglove and Lichtblick, by their WebSocket protocol (`foxglove.sdk.v1`,
//! once `foxglove.websocket.v1`).
//!
//! A topic of the run is observed only while a viewer has subscribed to one of its channels.
//! Messages are encoded once ([`gyre_recording::view`]), and a bounded number of each channel waits
//! for each viewer: a slow viewer loses messages, and nothing waits for it.

mod channels;
mod following;
mod hub;
mod measurements;
mod viewer;

pub use following::start;
pub use hub::Hub;
pub use viewer::{PROTOCOLS, serve};
