//! Localisation in a map of keyframes.
//!
//! - [`Map`]: keyframes with their poses in the map's frame, recognisable at any heading;
//! - [`Localiser`]: [`Localiser::find`], the first fix without prior from a single scan;
//!   [`Localiser::locate`], scan after scan: the first fix, then tracking against the map, until it
//!   is lost and finds itself again;
//! - [`DriveSearch`]: a whole drive, with all its poses in the map.
//!
//! # Method
//! 1. The scan is described and compared with the submaps of all keyframes of the map
//!    ([`gyre_estimation::places`]), each at several headings. Around the most similar ones the
//!    translation is searched, the best poses are aligned, and correlated with the map where the
//!    sensor could see anything. The best one is taken if it correlates well, and no other pose on
//!    the map nearly as well.
//! 2. From then on the pose is predicted by odometry and the scan is registered with the nearest
//!    keyframe of the map from there. A registration that correlates with the submap and is
//!    consistent with the prediction by chi-square updates the pose, as in a Kalman filter.
//! 3. Scans without such a registration are predicted. After [`LocaliserOptions::lost_after_s`] of
//!    them the localiser is lost, and begins with 1. again. A prediction is no fix, and away from
//!    all keyframes of the map there is no fix.
//!
//! # Frames and units
//! As in [`gyre_geometry`]; poses are in the map's frame, and covariances are of (x, y, yaw) along
//! its axes.

mod localiser;
mod map;
mod options;
mod placement;
mod registration;
mod sight;

pub use localiser::{Fix, Localisation, Localiser, Observation, Status};
pub use map::{Map, MapError};
pub use options::LocaliserOptions;
pub use placement::{DriveSearch, FoundKeyframe, PlacedDrive};
