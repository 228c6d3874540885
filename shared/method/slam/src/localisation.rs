//! Localisation in a map of keyframes: a single scan, scan after scan ([`Localiser`]), or a whole
//! drive ([`DriveSearch`]). Poses are in the map's frame, covariances of (x, y, yaw) along its
//! axes.
//!
//! A scan is described and compared with the submaps of all keyframes of the map, each at several
//! headings; around the most similar ones the translation is searched, and the best poses are
//! aligned. One is taken if it correlates well, and no other pose nearly as well. From then on the
//! prediction by odometry is registered with the nearest keyframe, as in a Kalman filter. After 3 s
//! without a registration the localiser is lost, and begins again. A prediction is no fix.

mod localiser;
mod map;
mod placement;
mod registration;
mod sight;

pub use localiser::{Fix, Localisation, Localiser, Observation, Status};
pub use map::{Map, MapError};
pub use placement::{DriveSearch, FoundKeyframe, PlacedDrive};
