use gyre_geometry::{Pose, interpolate};

/// Corrects the poses of all scans like the keyframes around them: a scan continues by odometry
/// from the keyframe before it, and evenly leads to the keyframe after it.
#[derive(Clone, Debug, Default)]
pub struct Correction {
    keyframes: Vec<Anchor>,
}

#[derive(Clone, Copy, Debug)]
struct Anchor {
    seq: u64,
    map_from_odometry: Pose,
}

impl Correction {
    pub(crate) fn new(keyframes: impl Iterator<Item = (u64, Pose)>, poses: &[Pose]) -> Self {
        let anchor = |((seq, odometry), pose): ((u64, Pose), &Pose)| Anchor {
            seq,
            map_from_odometry: pose * odometry.inverse(),
        };
        Self {
            keyframes: keyframes.zip(poses).map(anchor).collect(),
        }
    }

    /// Corrects the pose of scan `seq` by odometry, which is returned as it is before the first
    /// keyframe.
    pub fn correct(&self, seq: u64, odometry: &Pose) -> Pose {
        let after = self
            .keyframes
            .partition_point(|keyframe| keyframe.seq <= seq);
        let Some(before) = after.checked_sub(1).map(|last| self.keyframes[last]) else {
            return *odometry;
        };
        let continued = before.map_from_odometry * odometry;
        let Some(next) = self.keyframes.get(after) else {
            return continued;
        };
        let share = (seq - before.seq) as f64 / (next.seq - before.seq) as f64;
        interpolate(&continued, &(next.map_from_odometry * odometry), share)
    }
}
