//! SLAM on keyframes: the loops of a drive, and the trajectory corrected by them.
//!
//! Reading order:
//! - [`Keyframe`]: a scan whose pose is corrected, with all that a loop or a map needs of it;
//! - [`SlamConfig`]: the section `[slam]` of a run's configuration;
//! - [`KeyframeBuilder`]: makes keyframes from the poses of odometry;
//! - [`LoopCloser`]: which keyframes are of the same place; [`Query`]: the candidates of a keyframe
//!   with their verdicts;
//! - [`RecordLog`]: the files of keyframes, places and queries of a run; [`RecordReader`] follows
//!   them;
//! - [`Fixes`]: the fixes of GNSS of a drive;
//! - [`TrajectoryEstimator`]: the poses of all keyframes from odometry and loops;
//! - [`Correction`]: the poses of all scans.

mod closing;
mod config;
mod consistency;
mod correction;
mod exact;
mod fixes;
mod keyframe;
mod keyframe_builder;
pub mod localisation;
mod loops;
mod place;
mod records;
mod trajectory;
mod variance;
mod verdict;

pub use closing::{ClosingError, KeyframeSource, LoopCloser, LoopOptions};
pub use config::{SlamConfig, SlamKind};
pub use correction::Correction;
pub use fixes::{FixCounts, FixRefusal, Fixes};
pub use keyframe::Keyframe;
pub use keyframe_builder::{KeyframeBuilder, ScanPose};
pub use loops::{LoopCandidate, LoopOutcome, Query};
pub use place::Place;
pub use records::{Record, RecordLog, RecordReader, records_path};
pub use trajectory::{EstimatorKind, TrajectoryEstimator, TrajectoryOptions};
pub use verdict::{JudgedLoop, LoopVerdict};
