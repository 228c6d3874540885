//! SLAM on keyframes: the loops of a drive, and the trajectory corrected by them.
//!
//! Reading order:
//! - [`Keyframe`]: a scan whose pose is corrected, with all that a loop or a map needs of it;
//! - [`SlamConfig`]: the section `[slam]` of a run's configuration;
//! - [`KeyframeBuilder`]: makes keyframes from the poses of odometry;
//! - [`KeyframeLog`]: the file of all keyframes of a run; [`KeyframeReader`] follows it.

mod config;
mod keyframe;
mod keyframe_builder;
mod keyframes;

pub use config::{SlamConfig, SlamKind};
pub use keyframe::{Keyframe, MalformedKeyframe};
pub use keyframe_builder::{KeyframeBuilder, ScanPose};
pub use keyframes::{KeyframeError, KeyframeLog, KeyframeReader, keyframes_path};
