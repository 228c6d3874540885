//! Bags of ROS 2: a radar's scans in them as a [`Dataset`](gyre_datasets::Dataset), and bags that
//! `ros2 bag play` takes.
//!
//! A bag is a file of the MCAP profile `ros2`, or a folder of such files with a `metadata.yaml`.

mod bag;
mod files;
mod radar;
mod scans;
mod sensors;
mod topics;
mod writer;

use crate::{
    RecordingError,
    file::{Channel, McapFile, Message},
};

pub use files::is_bag;
pub use scans::{open, reopen};
pub use sensors::logged;
pub use writer::{BagWriter, Kept, Topic};
