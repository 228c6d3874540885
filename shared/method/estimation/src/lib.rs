//! Estimation of a trajectory from motions and loops.
//!
//! A keyframe is a scan whose pose is estimated. A [`Constraint`] is a measured relative pose of
//! two keyframes: a motion of the odometry, or a loop between keyframes of the same place.
//! [`TrajectoryFilter`] (the extended Kalman filter of Checchin et al.) and [`PoseGraph`] (sparse
//! least squares) estimate the poses; [`places`] recognises places and measures the loops.
//!
//! ```
//! use gyre_estimation::{Constraint, GraphOptions, PoseGraph};
//! use gyre_geometry::{Pose, UncertainMotion, pose};
//! use nalgebra::{Matrix3, Vector3};
//!
//! // Once around a square, with odometry that turns a little too far.
//! let covariance = Matrix3::from_diagonal(&Vector3::new(0.01, 0.01, 1e-3)); // 0.1 m, 0.03 rad
//! let side = UncertainMotion { motion: pose(10.0, 0.0, 91_f64.to_radians()), covariance };
//! let mut graph = PoseGraph::new(Pose::identity(), GraphOptions::default());
//! for keyframe in 0..4 {
//!     graph.apply(&Constraint::odometry(keyframe, side))?;
//! }
//! let same_place = UncertainMotion { motion: Pose::identity(), covariance: 0.01 * covariance };
//! graph.apply(&Constraint::closing(4, 0, same_place))?;
//! graph.solve()?;
//! assert!(graph.pose(4)?.motion.translation.vector.norm() < 0.01);
//! # Ok::<(), gyre_estimation::EstimationError>(())
//! ```
//!
//! Frames and units are those of [`gyre_geometry`]. Covariances are of (x, y, yaw), with x and y
//! along the axes of the frame: for a constraint, the frame of the keyframe `from`.

mod constraint;
mod error;
mod filter;
mod g2o;
mod graph;
mod kernel;
pub mod places;
mod relative;

pub use constraint::{CHI_SQUARE_99_9, CHI_SQUARE_99_9_PLANE, Constraint, Kind, Outcome, Verdict};
pub use error::EstimationError;
pub use filter::{FilterOptions, TrajectoryFilter};
pub use g2o::{G2o, G2oError};
pub use graph::{
    GraphOptions, PoseGraph, Position, Solution, WeightedLoop, WeightedPosition, align,
};
pub use kernel::Kernel;
