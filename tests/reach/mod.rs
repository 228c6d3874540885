//! Programs that are not of this build or not on this machine: stages of others, ROS 2, Python,
//! links.

#[cfg(not(feature = "full"))]
mod absent_features;
pub mod conformance;
mod foreign_stages;
#[cfg(feature = "link")]
mod link;
mod package;
mod python_function;
pub mod python_stage;
#[cfg(feature = "ros2")]
mod ros2;
#[cfg(feature = "ros2")]
mod ros2_driver;
#[cfg(feature = "ros2")]
mod ros2_map;
#[cfg(feature = "ros2")]
mod ros2_objects;
