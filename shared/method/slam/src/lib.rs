//! SLAM on keyframes: the loops of a drive, and the trajectory corrected by them.

mod closing;
mod config;
mod consistency;
mod correction;
pub mod estimation;
mod exact;
mod fixes;
mod keyframe;
mod keyframe_builder;
pub mod localisation;
mod loops;
pub mod mapping;
mod place;
mod trajectory;
mod variance;
mod verdict;

pub use crate::estimation::places::{LoopCandidate, LoopOutcome, SUBMAP_REACH_M};
pub use closing::{ClosingError, LoopCloser};
pub use config::{SlamConfig, SlamKind};
pub use correction::Correction;
pub use exact::split;
pub use fixes::{FixCounts, FixRefusal, Fixes};
pub use gyre_storage::{Record, RecordLog, RecordReader, records_path};
pub use keyframe::Keyframe;
pub use keyframe_builder::{KeyframeBuilder, ScanPose};
pub use loops::Query;
pub use place::Place;
pub use trajectory::{EstimatorKind, TrajectoryEstimator};
pub use verdict::{JudgedLoop, LoopVerdict};
