//! Localisation in a map of keyframes.
//!
//! - [`Map`]: keyframes with their poses in the map's frame, recognisable at any heading;
//! - [`Localiser`]: [`Localiser::find`], the first fix without prior from a single scan;
//!   [`Localiser::locate`], scan after scan: the first fix, then tracking against the map, until it
//!   is lost and finds itself again;
//! - [`DriveSearch`]: a whole drive, with all its poses in the map.
//!
//! A scan is described and compared with the submaps of all keyframes of the map, each at several
//! headings; around the most similar ones the translation is searched, and the best poses are
//! aligned. One is taken if it correlates well, and no other pose nearly as well. From then on the
//! prediction by odometry is registered with the nearest keyframe, and a registration that is
//! consistent with it updates the pose, as in a Kalman filter. After 3 s without one the localiser
//! is lost, and begins again. A prediction is no fix.
//!
//! # Frames and units
//! As in [`gyre_geometry`]; poses are in the map's frame, and covariances are of (x, y, yaw) along
//! its axes.

mod localiser;
mod map;
mod placement;
mod registration;
mod sight;

pub use localiser::{Fix, Localisation, Localiser, Observation, Status};
pub use map::{Map, MapError};
pub use placement::{DriveSearch, FoundKeyframe, PlacedDrive};
