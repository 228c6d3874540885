//! `pose`: the pose of the vehicle, which is also the credit that admits a new scan.

use gyre_geometry::{ComposedMotion, UncertainMotion, covariance, pose, xy_yaw};
use gyre_storage::{LogMagic, Record};

use crate::{
    item::Item,
    message::Header,
    motion::{MotionEstimate, MotionHeader, place},
    wire::{Bounds, REACH, wire},
};

wire! {
    /// A pose in the frame of the first scan: x forward, y to the left, yaw counter-clockwise, in
    /// (-pi, pi].
    pub struct PoseHeader = "gyre_pose_header_v14" {
        pub item: Item,
        pub motion: MotionEstimate,
        pub x_m: f64 [REACH],
        pub y_m: f64 [REACH],
        pub yaw_rad: f64 [Bounds::HalfTurn],
        /// Covariance of (x, y, yaw) in the frame of the first scan.
        pub covariance: covariance::Packed [Bounds::Covariance],
        /// The part of it that later poses have too, equal to it where the errors of motions are
        /// independent: see [`ComposedMotion::accumulated`].
        pub accumulated_covariance: covariance::Packed [Bounds::Covariance],
        /// Number of corrections of the whole trajectory (loop closures); always 0 while poses are
        /// only composed motions.
        pub trajectory_version: u64,
    }
}

impl Header for PoseHeader {
    fn words(&self, _: &[u8]) -> String {
        let place = place(self.x_m, self.y_m, self.yaw_rad);
        format!("{place}{}", self.motion.standing())
    }
}

impl PoseHeader {
    pub fn pose(&self) -> UncertainMotion {
        UncertainMotion {
            motion: pose(self.x_m, self.y_m, self.yaw_rad),
            covariance: covariance::unpack(&self.covariance),
        }
    }

    /// Returns the motion from the first scan to this one, to compose it with the next.
    pub fn composed(&self) -> ComposedMotion {
        ComposedMotion {
            motion: self.pose(),
            accumulated: covariance::unpack(&self.accumulated_covariance),
        }
    }
}

/// The journal of a run: its poses, then the end of the stream, since its item counts the scans.
impl Record for PoseHeader {
    const FILE: &'static str = "poses.journal";
    const MAGIC: LogMagic = *b"gyre journal v14";
    const LENGTH: Option<usize> = Some(size_of::<Self>());

    fn encode(&self, bytes: &mut Vec<u8>) {
        bytes.extend_from_slice(bytemuck::bytes_of(self));
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        bytemuck::try_pod_read_unaligned(bytes).ok()
    }
}

/// Composes the previous pose (the origin without one) and a motion (zero at the start of a chain)
/// to the next pose. The covariance is propagated to first order (Checchin et al., Eqs. 1 and 2),
/// but the noise of a scan's registration does not accumulate: see
/// [`ComposedMotion`].
pub fn compose(previous: Option<&PoseHeader>, motion: &MotionHeader) -> PoseHeader {
    let start = PoseHeader::default();
    let previous = previous.unwrap_or(&start);
    let next = previous.composed().then(&motion.motion.motion());
    let pose = next.motion;
    let [x_m, y_m, yaw_rad] = xy_yaw(&pose.motion);
    PoseHeader {
        item: motion.item,
        motion: motion.motion,
        x_m,
        y_m,
        yaw_rad,
        covariance: covariance::pack(&pose.covariance),
        accumulated_covariance: covariance::pack(&next.accumulated),
        trajectory_version: previous.trajectory_version,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Compares with `Odometry` in one process, to the bit.
    #[test]
    fn poses_are_those_of_motions_composed_without_messages() {
        let mut header: Option<PoseHeader> = None;
        let mut composed = ComposedMotion::default();
        for k in 0..1000 {
            let at = f64::from(k);
            let moves = if k % 7 == 0 { 0.0 } else { 1.0 };
            let motion = MotionEstimate {
                x_m: moves * (2.0 + (0.3 * at).sin()),
                y_m: moves * 0.1 * (0.7 * at).sin(),
                yaw_rad: moves * 0.05 * (0.05 * at).sin(),
                covariance: [4e-4, 1e-5, -2e-6, 1e-4, 3e-7, 1e-6],
                drift_share: 0.25,
                scale_sigma: 0.01,
                ..MotionEstimate::default()
            };
            let message = MotionHeader {
                motion,
                ..MotionHeader::default()
            };
            let next = compose(header.as_ref(), &message);
            composed = composed.then(&motion.motion()).normalized();
            assert_eq!(next.composed(), composed, "pose {k}");
            header = Some(next);
        }
    }
}
