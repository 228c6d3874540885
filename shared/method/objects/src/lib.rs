//! Moving objects: a network finds in the points of the last scans which vehicles move, and filters
//! track them.
//!
//! [`ObjectTracker::update`] is the method on one page. In the order of the data:
//!
//! - `raster`: the last scans around the vehicle, drawn as planes,
//! - `detector`: vehicles that move, by the network,
//! - `filter`: the filter of a track, Kalman filters of several turn rates with the time of each
//!   azimuth,
//! - `track`: birth, confirmation, coasting and death,
//! - `assignment`: assigns detections to tracks.
//!
//! # Frames and units
//! As in [`gyre_geometry`]: x forward, y left, yaw counter-clockwise; m, rad, s. Objects are in the
//! odometry frame: the frame of the first scan.

mod assignment;
mod config;
mod detector;
mod filter;
mod object;
mod raster;
mod track;
mod tracker;

pub use assignment::assign;
pub use config::{ObjectsConfig, ObjectsError, ObjectsKind};
pub use object::{Object, PlacedScan};
pub use tracker::ObjectTracker;
