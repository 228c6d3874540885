//! SLAM on keyframes: the loops of a drive, and the trajectory corrected by them.
//!
//! Reading order:
//! - [`Keyframe`]: a scan whose pose is corrected, with all that a loop or a map needs of it.

mod keyframe;

pub use keyframe::{Keyframe, MalformedKeyframe};
