//! The ROS 2 messages that Gyre speaks, without I/O.

pub mod builtin_interfaces;
mod definition;
pub mod diagnostic_msgs;
mod domain;
pub mod frames;
pub mod geometry_msgs;
pub mod lifecycle_msgs;
pub mod messages;
pub mod nav_msgs;
pub mod navtech_msgs;
pub mod objects;
pub mod radar;
pub mod rosgraph_msgs;
pub mod sensor_msgs;
pub mod std_msgs;
pub mod tf2_msgs;
pub mod vision_msgs;
pub mod visualization_msgs;

pub use definition::{Definition, Ros2Message, decode, encode};
pub use domain::Domain;
pub use frames::{Mounting, SAVED_MAP, Vehicle};
