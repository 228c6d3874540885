use std::mem;

use gyre_geometry::{OdometryMotion, Twist, UncertainMotion};

use crate::{Keyframe, estimation::places::KeyframeSelector};

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
    selector: KeyframeSelector,
    /// The motion since the last keyframe, with the covariance of its drift.
    motion: UncertainMotion,
}

impl Default for KeyframeBuilder {
    fn default() -> Self {
        Self {
            selector: KeyframeSelector::default(),
            motion: UncertainMotion::identity(),
        }
    }
}

impl KeyframeBuilder {
    /// Continues after a keyframe, `path_m` along the path, whose pose is given as
    /// [`next`](Self::next) takes it.
    pub fn resume(&mut self, keyframe: &UncertainMotion, path_m: f64) {
        self.selector.resume(keyframe.motion, path_m);
        self.motion = UncertainMotion::identity();
    }

    /// Takes the next scan. Returns it if it becomes a keyframe, with no points yet.
    pub fn next(&mut self, scan: &ScanPose) -> Option<Keyframe> {
        self.motion = self.motion.then(&scan.motion.drift());
        let path_m = self.selector.next(&scan.pose.motion)?;
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
            covariance: nalgebra::Matrix3::from_diagonal_element(0.01),
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
