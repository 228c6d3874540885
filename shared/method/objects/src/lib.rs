//! Moving objects: a network finds in the points of the last scans which vehicles move, and filters
//! track them. [`ObjectTracker::update`] is the method on one page. Objects are in the odometry
//! frame: the frame of the first scan.

mod assignment;
mod config;
mod detector;
mod filter;
mod object;
mod raster;
mod track;
mod tracker;

pub use assignment::assign;
pub use config::{ObjectsConfig, ObjectsKind};
pub use object::PlacedScan;
pub use tracker::ObjectTracker;
