//! The keyframes in a map's folder, for localisation.

use std::path::Path;

use gyre_geometry::Pose;
use gyre_radar::Trajectory;
use gyre_slam::{Keyframe, RecordReader};

use super::SAME_TIME_NS;
use crate::Failure;

/// Keeps the keyframes that have a pose in a map's folder, with their poses in the frame of the first one.
///
/// # Errors
/// No keyframe has a pose, or the folder cannot be written.
pub fn keep(
    keyframes: &mut RecordReader<Keyframe>,
    poses: &Trajectory,
    folder: &Path,
) -> Result<(), Failure> {
    let (mut kept, mut first): (_, Option<Pose>) = (Vec::new(), None);
    for index in 0..keyframes.len() {
        let mut keyframe = keyframes.read(index)?;
        if let Some(pose) = poses.near(keyframe.stamp_ns, SAME_TIME_NS) {
            keyframe.pose.motion = first.get_or_insert(pose).inv_mul(&pose);
            kept.push(keyframe);
        }
    }
    Ok(gyre_localisation::Map::new(kept)?.save(folder)?)
}
