//! KITTI odometry errors: drift of translation and rotation over segments of 100 to 800 m.
//!
//! Geiger et al., "Are we ready for autonomous driving?", CVPR 2012, as the odometry development
//! kit computes them. They need no alignment: only motions within a segment are compared.

use std::num::NonZeroUsize;

use gyre_geometry::Pose;
use nalgebra::Complex;
use serde::Serialize;

use crate::evaluation::{
    MatchedPoses,
    segments::{PerLength, Segment},
};

/// The KITTI odometry errors, means over all segments of all lengths.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Kitti {
    /// Translation error, % of the segment length.
    pub translation_percent: f64,
    pub rotation_deg_per_100m: f64,
    /// The same in degrees per km: 1000 times the "deg/m" of the KITTI leaderboard.
    pub rotation_deg_per_km: f64,
    pub segments: usize,
    /// Poses from the start of a segment to the start of the next.
    pub step: NonZeroUsize,
    /// The means for each length that has segments, shortest first.
    pub by_length: Vec<KittiLength>,
}

#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct KittiLength {
    pub length_m: f64,
    /// Translation error, % of the segment length.
    pub translation_percent: f64,
    pub rotation_deg_per_100m: f64,
    pub segments: usize,
}

/// Returns the mean errors of the segments that start at every `step`-th pose, `None` if the path
/// is not longer than 100 m.
///
/// `step` is 10 in the development kit (1 s of its lidar at 10 Hz); radar papers use 10 or 4 (1 s
/// at 4 Hz).
pub fn kitti(matched: &MatchedPoses, step: NonZeroUsize) -> Option<Kitti> {
    let errors = PerLength::of(matched, step, |segment| segment_error(matched, segment));
    let ([translation_percent, rotation_deg_per_100m], segments) = errors.mean()?;
    let by_length = errors.means();
    let by_length = by_length.map(
        |(length_m, [translation, rotation], segments)| KittiLength {
            length_m,
            translation_percent: translation,
            rotation_deg_per_100m: rotation,
            segments,
        },
    );
    Some(Kitti {
        translation_percent,
        rotation_deg_per_100m,
        rotation_deg_per_km: 10.0 * rotation_deg_per_100m,
        segments,
        step,
        by_length: by_length.collect(),
    })
}

fn segment_error(matched: &MatchedPoses, segment: Segment) -> [f64; 2] {
    let estimated = Motion::within(matched.estimate(), segment);
    let error = estimated.to(&Motion::within(matched.truth(), segment));
    let per_100m = 100.0 / segment.length_m();
    [error.translation.norm(), error.angle_rad().to_degrees()].map(|it| it * per_100m)
}

/// A planar rigid motion in complex numbers: x -> rotation x + translation.
///
/// The inverse is a true division, not a conjugation, and the angle an arc cosine, because the
/// development kit inverts matrices and takes their trace. This matters only in the fifth decimal
/// of published figures: rotations in files have six decimals.
struct Motion {
    rotation: Complex<f64>,
    translation: Complex<f64>,
}

impl Motion {
    fn of(pose: &Pose) -> Self {
        Self {
            rotation: *pose.rotation.complex(),
            translation: Complex::new(pose.translation.x, pose.translation.y),
        }
    }

    fn within(poses: &[Pose], segment: Segment) -> Self {
        Self::of(&poses[segment.first]).to(&Self::of(&poses[segment.last]))
    }

    fn to(&self, other: &Self) -> Self {
        Self {
            rotation: other.rotation / self.rotation,
            translation: (other.translation - self.translation) / self.rotation,
        }
    }

    /// acos((trace - 1) / 2) of the rotation as a 3 x 3 matrix, whose trace is 1 + 2 cos.
    fn angle_rad(&self) -> f64 {
        self.rotation.re.clamp(-1.0, 1.0).acos()
    }
}
