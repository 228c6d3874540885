//! Moving objects: finds among the points of a scan what the last seconds do not explain, and
//! tracks it.
//!
//! [`ObjectTracker::update`] is the method on one page. In the order of the data:
//!
//! - `returns`: the points of a scan, deskewed by the motion of the vehicle and placed in the frame
//!   of the odometry,
//! - `evidence`: where the last scans saw something and where they saw nothing,
//! - `clusters`: returns where nothing was before, merged to clusters,
//! - `filter`: the filter of a track, Kalman filters of several turn rates with the time of each
//!   return,
//! - `extent`: length and width, and the centre by the ends that are seen,
//! - `score`: how likely a track is an object, and not clutter,
//! - `track`: birth, confirmation, coasting and death,
//! - `assignment`: which cluster belongs to which track.
//!
//! # Frames and units
//! Those of [`gyre_geometry`]: x forward, y left, yaw counter-clockwise; m, rad, s. Objects are in
//! the frame of the odometry, that of the first scan.

mod assignment;
mod clusters;
mod config;
mod evidence;
mod extent;
mod filter;
mod object;
mod returns;
mod score;
mod track;
mod tracker;

pub use assignment::assign;
pub use config::{ObjectsConfig, ObjectsError, ObjectsKind};
pub use filter::{Filter, Innovation, Sighting};
pub use object::Object;
pub use returns::PlacedScan;
pub use tracker::ObjectTracker;
