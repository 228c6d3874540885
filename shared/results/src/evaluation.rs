//! Metrics of planar odometry against ground truth: KITTI drift, ATE, RPE, segment error and NEES,
//! with plots; and of tracked objects. [`evaluate`] is the whole method, one line a step.
//!
//! It computes on poses and stamps in memory; files are read elsewhere. A
//! [`Pose`](gyre_geometry::Pose) is the pose of the sensor in a fixed frame (REP-103: x forward, y
//! left, yaw counter-clockwise); stamps are in ns. Estimate and ground truth may have different
//! fixed frames.

pub mod associate;
pub mod ate;
pub mod bands;
mod display;
pub mod end;
mod error;
pub mod fomo;
mod gaps;
pub mod handedness;
pub mod kitti;
pub mod loops;
mod matched;
pub mod motions;
mod mounting;
pub mod nees;
pub mod objects;
pub mod plot;
pub mod report;
pub mod rpe;
pub mod seg;
mod segments;
mod truth_sigma;

pub use associate::{Coverage, associate, resampled};
pub use ate::{Ate, align, ate};
pub use bands::{BandSample, Bands, bands};
pub use end::{EndError, end_error};
pub use error::EvaluationError;
pub use fomo::{Fomo, fomo};
pub use gaps::max_gap_ns;
pub use handedness::{Axes, HeadingFault};
pub use kitti::{Kitti, kitti};
pub use loops::{LoopErrors, loop_errors};
pub use matched::{MatchedPoses, path_m};
pub use motions::{MatchedMotions, TimedMotion, part};
pub use nees::{Nees, NeesFigure, NeesFigures, NeesLength, NeesOptions, nees};
pub use objects::{
    Hota, ObjectBand, ObjectErrors, ObjectScan, TrackedObject, TrueObject, object_errors,
};
pub use report::{Evaluation, STEP, evaluate};
pub use rpe::{PairError, Rpe, rpe};
pub use seg::{Seg, seg};
pub use segments::SEGMENT_LENGTHS_M;
pub use truth_sigma::TruthSigma;
