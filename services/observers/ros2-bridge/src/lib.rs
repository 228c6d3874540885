//! The bridge to ROS 2, by DDS and without ROS 2: [`Bridge`] publishes the results of a run, and
//! [`source`] receives a Navtech radar from its driver.

#![cfg(feature = "dds")]

mod bridge;
mod commands;
mod following;
mod health;
mod lifecycle;
mod live_map;
mod motions;
mod node;
mod outlet;
mod run_state;
mod services;
mod settings;
pub mod source;
mod topics;
mod wakeups;

pub use bridge::Bridge;
pub use settings::{MapSettings, RunSettings, Settings};
