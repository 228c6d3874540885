//! The bridge to ROS 2, by DDS and without ROS 2: [`Bridge`] publishes the results of a run, and
//! [`source`] receives a Navtech radar from its driver.

#![cfg(feature = "dds")]

mod bridge;
mod following;
mod health;
mod live_map;
mod node;
mod outlet;
mod run_state;
mod settings;
pub mod source;

pub use bridge::Bridge;
pub use settings::{MapSettings, MapSettingsOf, Settings};
