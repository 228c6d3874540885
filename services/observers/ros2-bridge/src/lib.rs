//! The bridge to ROS 2, by DDS and without ROS 2: what a run finds is published, and a Navtech radar is received from its driver.
//!
//! Reading order:
//! 1. [`Domain`]: where on the network; `node`: a node there, and its topics.
//! 2. [`Bridge`]: an observer of a run, which publishes it. `following` are its threads, `shared` is what they share.
//! 3. `clock`, [`Mounting`], `health`, `live_map`: stamps, frames, diagnostics, the map.
//! 4. [`source`]: the topics of Navtech's driver as the source of a run.

#![cfg(feature = "dds")]

mod bridge;
mod clock;
mod domain;
mod following;
mod health;
mod live_map;
mod node;
mod outlet;
mod shared;
pub mod source;

pub use bridge::{Bridge, MapOf, MapSettings, Settings};
pub use domain::{Domain, DomainError};
pub use gyre_ros2_messages::{BadMounting, Mounting, frames::Frames};
pub use node::NodeError;
