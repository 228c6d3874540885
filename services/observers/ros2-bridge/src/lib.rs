//! The bridge to ROS 2, by DDS and without ROS 2: publishes the results of a run, and receives a
//! Navtech radar from its driver.
//!
//! Reading order:
//! 1. `node`: a node in a domain, and its topics.
//! 2. `Bridge`: an observer of a run, which publishes it. `following` are its threads,
//!    `run_state` is their shared state.
//! 3. `clock`, `Mounting`, `health`, `live_map`: stamps, frames, diagnostics, the map.
//! 4. `source`: the topics of Navtech's driver as the source of a run.

#![cfg(feature = "dds")]

mod bridge;
mod clock;
mod following;
mod health;
mod live_map;
mod node;
mod outlet;
mod run_state;
mod settings;
pub mod source;

pub use bridge::Bridge;
pub use gyre_ros2_messages::{BadMounting, Mounting, frames::Frames};
pub use node::NodeError;
pub use settings::{MapSettings, MapSettingsOf, Settings};
