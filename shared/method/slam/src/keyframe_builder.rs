use std::mem;

use gyre_geometry::{OdometryMotion, Pose, Twist, UncertainMotion};
use nalgebra::Matrix3;

use crate::{Keyframe, closing::GAP_M};

/// A scan becomes a keyframe at this distance or rotation from the last keyframe, m and degrees.
const DISTANCE_M: f64 = 2.0;
const ANGLE_DEG: f64 = 15.0;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ScanPose {
    /// The scan's number in the run, from 0 without gaps.
    pub seq: u64,
    /// The sensor's own number of the scan.
    pub scan: u64,
    /// Time of the scan, the middle of the sweep, ns since 1970 on the sensor's clock.
    pub stamp_ns: i64,
    pub pose: UncertainMotion,
    /// The motion from the scan before; zero where the chain of motions starts.
    pub motion: OdometryMotion,
    /// Time since the scan before, s; zero where the chain of motions starts.
    pub interval_s: f64,
}

impl ScanPose {
    /// Returns the velocity of the motion into the scan; zero where the chain of motions starts.
    fn twist(&self) -> Twist {
        match self.interval_s > 0.0 {
            true => Twist::from_chord(&self.motion.motion, self.interval_s),
            false => Twist::default(),
        }
    }
}

/// Selects the keyframes of a drive, and composes the motions between them. The first scan becomes
/// a keyframe.
#[derive(Debug, Clone)]
pub struct KeyframeBuilder {
    /// The pose of the last keyframe, and the length of the path through all keyframes up to it, m.
    last: Option<(Pose, f64)>,
    /// The motion since the last keyframe, with the covariance of its drift.
    motion: UncertainMotion,
    /// True if the next scan becomes a keyframe, wherever it is.
    is_due: bool,
    /// The covariance of the pose of the next scan, if that is given and not measured.
    given: Option<Matrix3<f64>>,
}

impl Default for KeyframeBuilder {
    fn default() -> Self {
        Self {
            last: None,
            motion: UncertainMotion::identity(),
            is_due: false,
            given: None,
        }
    }
}

impl KeyframeBuilder {
    /// Continues after a keyframe, `path_m` along the path, whose pose is given as
    /// [`next`](Self::next) takes it.
    pub fn resume(&mut self, keyframe: &UncertainMotion, path_m: f64) {
        self.last = Some((keyframe.motion, path_m));
        self.motion = UncertainMotion::identity();
    }

    /// Makes the next scan a keyframe.
    pub fn require_next(&mut self) {
        self.is_due = true;
    }

    /// Makes the next scan a keyframe whose pose is given, with this covariance of (x, y, yaw), the
    /// same along all axes: the motion to it is not measured.
    pub fn give_next(&mut self, covariance: Matrix3<f64>) {
        self.is_due = true;
        self.given = Some(covariance);
    }

    /// Takes the next scan. Returns it if it becomes a keyframe, with no points yet.
    pub fn next(&mut self, scan: &ScanPose) -> Option<Keyframe> {
        self.motion = self.motion.then(&scan.motion.drift());
        let pose = scan.pose.motion;
        let path_m = match &self.last {
            None => 0.0,
            Some((last, path_m)) => {
                let motion = last.inv_mul(&pose);
                let distance_m = motion.translation.vector.norm();
                let angle_rad = motion.rotation.angle().abs();
                let is_far = distance_m >= DISTANCE_M || angle_rad >= ANGLE_DEG.to_radians();
                if !is_far && !self.is_due {
                    return None;
                }
                match self.given.take() {
                    None => path_m + distance_m,
                    Some(covariance) => {
                        self.motion = UncertainMotion { motion, covariance };
                        // The two are in no common submap, and can close a loop.
                        path_m + GAP_M
                    }
                }
            }
        };
        (self.is_due, self.given) = (false, None);
        self.last = Some((pose, path_m));
        let motion = mem::replace(&mut self.motion, UncertainMotion::identity());
        Some(Keyframe {
            seq: scan.seq,
            scan: scan.scan,
            stamp_ns: scan.stamp_ns,
            pose: scan.pose,
            motion,
            noise: scan.motion.noise_of_pose(),
            twist: scan.twist(),
            path_m,
            points: Vec::new(),
        })
    }
}

#[cfg(test)]
mod tests {
    use gyre_geometry::pose;

    use super::*;

    /// Scans of a turning drive, 1.5 m apart.
    fn scans(count: u64) -> Vec<ScanPose> {
        let step = UncertainMotion {
            motion: pose(1.5, 0.1, 0.05),
            covariance: Matrix3::from_diagonal_element(0.01),
        };
        let step = OdometryMotion::independent(step);
        let mut at = UncertainMotion::identity();
        let scan = |seq| {
            let motion = if seq == 0 {
                OdometryMotion::default()
            } else {
                step
            };
            at = at.then(&motion.alone()).normalized();
            ScanPose {
                seq,
                scan: seq,
                stamp_ns: seq as i64,
                pose: at,
                motion,
                interval_s: if seq == 0 { 0.0 } else { 0.25 },
            }
        };
        (0..count).map(scan).collect()
    }

    #[test]
    fn two_metres_or_fifteen_degrees_make_a_keyframe() {
        let mut builder = KeyframeBuilder::default();
        let mut path_dm = |x_m: f64, degrees: f64| {
            let mut scan = scans(1)[0];
            scan.pose.motion = pose(x_m, 0.0, degrees.to_radians());
            builder.next(&scan).map(|it| (10.0 * it.path_m).round())
        };
        assert_eq!([path_dm(0.0, 0.0), path_dm(1.9, 0.0)], [Some(0.0), None]);
        assert_eq!([path_dm(2.1, 0.0), path_dm(2.1, 14.0)], [Some(21.0), None]);
        assert_eq!([path_dm(2.1, 16.0), path_dm(4.0, 16.0)], [Some(21.0), None]);
        assert_eq!(path_dm(4.2, 16.0), Some(42.0));
    }

    #[test]
    fn a_keyframe_has_the_motion_since_the_one_before_and_the_velocity_into_its_scan() {
        let mut builder = KeyframeBuilder::default();
        let keyframes: Vec<Keyframe> = scans(7).iter().filter_map(|it| builder.next(it)).collect();
        let seqs: Vec<u64> = keyframes.iter().map(|keyframe| keyframe.seq).collect();
        assert_eq!(seqs, [0, 2, 4, 6]);
        assert_eq!(keyframes[0].motion, UncertainMotion::identity());
        assert_eq!(keyframes[0].twist, Twist::default());
        assert!((keyframes[1].twist.speed_mps() - 6.0).abs() < 0.05);
        for pair in keyframes.windows(2) {
            let composed = pair[0].pose.then(&pair[1].motion);
            let apart = composed.error(&pair[1].pose.motion);
            assert!(apart.norm() < 1e-12, "{apart}");
            assert!((composed.covariance - pair[1].pose.covariance).norm() < 1e-12);
        }
    }

    #[test]
    fn a_given_pose_is_a_keyframe_with_its_deviation_far_along_the_path() {
        let mut builder = KeyframeBuilder::default();
        let scans = scans(3);
        builder.next(&scans[0]);
        builder.require_next();
        let required = builder.next(&scans[1]).unwrap();
        assert_eq!(required.motion.motion, scans[1].motion.motion);
        let covariance = Matrix3::from_diagonal_element(0.25);
        builder.give_next(covariance);
        let mut given = scans[2];
        (given.pose.motion, given.motion) = (pose(9.0, 9.0, 1.0), OdometryMotion::default());
        let keyframe = builder.next(&given).unwrap();
        let apart = required.pose.motion * keyframe.motion.motion;
        let apart = apart.inv_mul(&given.pose.motion);
        assert!(apart.translation.vector.norm() < 1e-12 && apart.rotation.angle().abs() < 1e-12);
        assert_eq!(keyframe.motion.covariance, covariance);
        assert_eq!(keyframe.path_m, required.path_m + GAP_M);
        assert!(builder.next(&given).is_none(), "once");
    }

    #[test]
    fn a_builder_that_continues_after_a_keyframe_makes_the_same_ones() {
        let scans = scans(9);
        let mut builder = KeyframeBuilder::default();
        let all: Vec<Keyframe> = scans.iter().filter_map(|it| builder.next(it)).collect();
        let mut resumed = KeyframeBuilder::default();
        resumed.resume(&scans[4].pose, all[2].path_m);
        let rest: Vec<Keyframe> = scans[5..]
            .iter()
            .filter_map(|it| resumed.next(it))
            .collect();
        assert_eq!(rest, all[3..]);
    }
}
