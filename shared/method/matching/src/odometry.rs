//! Radar odometry in one process: the whole method on one page.
//!
//! [`Odometry::register`] is the method: compensate, rasterise, mask, rotate, translate, refine,
//! compose. The processes of a run compose the same parts from [`gyre_masking`] and
//! [`gyre_matching`], so their motions are the same bits.
//!
//! # Frames and units
//! As in [`gyre_geometry`]: x forward, y left, yaw counter-clockwise; m, rad, s.

mod compensation;
mod config;
mod odometry;
mod pair;
mod parts;
mod registered;
mod search;

pub use config::{OdometryConfig, SearchConfig, SearchKind};
pub use odometry::Odometry;
pub use pair::Pair;
pub use parts::Parts;
pub use registered::{OdometryError, Outcome, Registered, SetupError};
pub use search::{DecoupledSearch, Search};
