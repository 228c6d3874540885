//! Estimation of a trajectory from motions and loops.
//!
//! A keyframe is a scan whose pose is estimated. A [`Constraint`] is a measured relative pose of
//! two keyframes: a motion of the odometry, or a loop between keyframes of the same place.
//! [`TrajectoryFilter`] (the extended Kalman filter of Checchin et al.) and [`PoseGraph`] (sparse
//! least squares) estimate the poses; [`places`] recognises places and measures the loops.
//!
//! Frames and units are as in [`gyre_geometry`]. Covariances are of (x, y, yaw), with x and y
//! along the axes of the frame: for a constraint, the frame of the keyframe `from`.

mod constraint;
mod error;
mod filter;
mod g2o;
mod graph;
mod kernel;
pub mod places;
mod relative;

pub use constraint::{
    CHI_SQUARE_99_9, CHI_SQUARE_99_9_PLANE, Constraint, Kind, Outcome, Verdict, chi_square,
};
pub use error::EstimationError;
pub use filter::TrajectoryFilter;
pub use g2o::{G2o, G2oError};
pub(crate) use graph::PHI;
pub use graph::{
    GraphOptions, PoseGraph, Position, Solution, WeightedLoop, WeightedPosition, align,
};
pub use kernel::Kernel;
