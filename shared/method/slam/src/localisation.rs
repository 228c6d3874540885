//! Localisation in a map of keyframes: a single scan, scan after scan ([`Localiser`]), or a whole
//! drive ([`DriveSearch`]). Poses are in the map's frame, covariances of (x, y, yaw) along its
//! axes.

mod localiser;
mod map;
mod placement;
mod sight;

pub use localiser::{Fix, Localisation, Localiser, Observation, Status};
pub use map::{Map, MapError};
pub use placement::{DriveSearch, FoundKeyframe, PlacedDrive};
