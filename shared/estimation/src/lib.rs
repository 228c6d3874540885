//! Estimation of a trajectory from motions and loops.
//!
//! A keyframe is a scan whose pose is estimated. A [`Constraint`] is a measured relative pose of two keyframes: a motion of the
//! odometry, or a loop between keyframes of the same place. Reading order:
//! - [`Constraint`]: a measurement, in the form that every estimator takes; [`Verdict`]: its chi-square test;
//! - [`TrajectoryFilter`]: the extended Kalman filter of Checchin et al. over the poses of all keyframes, for short trajectories.
//!
//! # Frames and units
//! Those of [`gyre_geometry`]: poses are those of keyframes in the frame of the first one (or in the frame of the pose that it was
//! given); x forward, y left in m, yaw counter-clockwise in rad. Covariances are those of (x, y, yaw) along the axes of the frame that
//! the pose is in: for a constraint, the keyframe `from`.

mod constraint;
mod error;
mod filter;
mod relative;

pub use constraint::{CHI_SQUARE_99_9, Constraint, Kind, Outcome, Verdict};
pub use error::EstimationError;
pub use filter::{FilterOptions, TrajectoryFilter};
