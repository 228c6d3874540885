//! The keyframes in a map's folder, for localisation.

use gyre_configuration::terminal::Failure;
use gyre_geometry::Pose;
use gyre_radar::Trajectory;
use gyre_slam::{Keyframe, RecordReader, localisation::Map};

/// Returns the keyframes that have a pose, with their poses in the frame of the first one.
pub fn placed(keyframes: &mut RecordReader<Keyframe>, poses: &Trajectory) -> Result<Map, Failure> {
    let (mut kept, mut first): (_, Option<Pose>) = (Vec::new(), None);
    for index in 0..keyframes.len() {
        let mut keyframe = keyframes.read(index)?;
        if let Some(pose) = poses.near(keyframe.stamp_ns, Trajectory::ROUNDING_NS) {
            keyframe.pose.motion = first.get_or_insert(pose).inv_mul(&pose);
            kept.push(keyframe);
        }
    }
    Ok(Map::new(kept)?)
}
