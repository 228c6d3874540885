//! Estimation of a trajectory from motions and loops.
//!
//! A keyframe is a scan whose pose is estimated. A [`Constraint`] is a measured relative pose of
//! two keyframes: a motion of the odometry, or a loop between keyframes of the same place. Reading
//! order:
//! - [`Constraint`]: a measurement, in the form that both estimators take; [`Verdict`]: its
//!   chi-square test;
//! - [`TrajectoryFilter`]: the extended Kalman filter of Checchin et al. over the poses of all
//!   keyframes, for short trajectories;
//! - [`PoseGraph`]: sparse least squares, for days of driving and many loops; [`Kernel`]: its
//!   treatment of wrong loops; [`Position`]: measured positions in a frame of their own;
//! - [`G2o`]: pose graphs as files of other programs;
//! - [`places`]: recognises places that are visited again, and measures the loops between them.
//!
//! A drive once around a square, whose odometry turns a little too far, and the loop that corrects
//! it:
//!
//! ```
//! use gyre_estimation::{Constraint, GraphOptions, PoseGraph};
//! use gyre_geometry::{Pose, UncertainMotion, pose};
//! use nalgebra::{Matrix3, Vector3};
//!
//! let covariance = Matrix3::from_diagonal(&Vector3::new(0.01, 0.01, 1e-3)); // 0.1 m, 0.03 rad
//! let side = UncertainMotion { motion: pose(10.0, 0.0, 91_f64.to_radians()), covariance };
//! let mut graph = PoseGraph::new(Pose::identity(), GraphOptions::default());
//! for keyframe in 0..4 {
//!     graph.apply(&Constraint::odometry(keyframe, side))?;
//! }
//! assert!(graph.poses()[4].translation.vector.norm() > 0.4);
//!
//! let same_place = UncertainMotion { motion: Pose::identity(), covariance: 0.01 * covariance };
//! graph.apply(&Constraint::closing(4, 0, same_place))?;
//! graph.solve()?;
//! let end = graph.pose(4)?;
//! assert!(end.motion.translation.vector.norm() < 0.01);
//! assert!(end.covariance[(0, 0)].sqrt() < 0.02);
//! # Ok::<(), gyre_estimation::EstimationError>(())
//! ```
//!
//! # Frames and units
//! As in [`gyre_geometry`]: x forward, y left in m, yaw counter-clockwise in rad. Poses are
//! keyframe poses in the frame of the given first pose. The covariance of a pose or of a motion is
//! the covariance of its (x, y, yaw), with x and y along the axes of its frame: for a constraint,
//! the frame of the keyframe `from`.

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
