//! Moving objects found by a network in the points of the last scans, and tracked.
//!
//! On simulated drives it finds far more than [`gyre_objects`], and less that is false; in real fog
//! it does not find the car that that one finds, since simulated cars echo more strongly than real
//! ones. So the program does not use it yet: see docs/decisions.md, "Moving objects".
//! [`NetworkTracker::update`] is the method on one page. In the order of the data:
//!
//! - `raster`: the last scans around the vehicle, drawn as planes,
//! - `detector`: vehicles that move, by the network,
//! - `track`: birth, confirmation, coasting and death, with the filter of [`gyre_objects`].
//!
//! # Frames and units
//! Those of [`gyre_geometry`]: x forward, y left, yaw counter-clockwise; m, rad, s. Objects are in
//! the frame of the odometry, that of the first scan.

mod config;
mod detector;
mod raster;
mod track;
mod tracker;

pub use config::NetworkConfig;
pub use detector::NetworkError;
pub use tracker::NetworkTracker;
