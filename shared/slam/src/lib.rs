//! SLAM on keyframes: the loops of a drive, and the trajectory corrected by them.
//!
//! Reading order:
//! - [`Keyframe`]: a scan whose pose is corrected, with all that a loop or a map needs of it;
//! - [`KeyframeLog`]: the file of all keyframes of a run; [`KeyframeReader`] follows it.

mod keyframe;
mod keyframes;

pub use keyframe::{Keyframe, MalformedKeyframe};
pub use keyframes::{KeyframeError, KeyframeLog, KeyframeReader, keyframes_path};
