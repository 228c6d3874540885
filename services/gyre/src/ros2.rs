//! ROS 2: `gyre ros2`, and a radar behind Navtech's driver as a source. A build without the feature
//! `ros2` refuses both.

#[cfg(feature = "ros2")]
#[path = "ros2/present.rs"]
mod build;
#[cfg(not(feature = "ros2"))]
#[path = "ros2/absent.rs"]
mod build;

pub use build::{ask, publish, receive};
