//! `predicted_pose`: the pose between the scans of a live radar.

use gyre_geometry::{
    Twist, UncertainMotion, covariance,
    samples::{LearntErrors, PredictionStart, Witness},
    xy_yaw,
};

use crate::{
    item::Item,
    message::Header,
    motion::place,
    pose::PoseHeader,
    wire::{Bounds, REACH, wire},
};

wire! {
    /// A pose that is predicted from the last one by gyro, wheels and the last velocity, in the
    /// same frame.
    pub struct PredictedPoseHeader = "gyre_predicted_pose_header_v1" {
        /// `seq` counts the predictions of the run, from 0; `stamp_ns` is the time of this one on
        /// the sensor's clock, `scan` the scan of the last pose.
        pub item: Item,
        pub x_m: f64 [REACH],
        pub y_m: f64 [REACH],
        pub yaw_rad: f64 [Bounds::HalfTurn],
        /// Covariance of (x, y, yaw) in the frame of the first scan.
        pub covariance: covariance::Packed [Bounds::Covariance],
        /// Time since the last pose, ns.
        pub ahead_ns: i64 [Bounds::AtLeast(1)],
    }
}

impl PredictedPoseHeader {
    /// A prediction from this pose to a time, ns.
    pub fn new(last: &PoseHeader, predicted: &UncertainMotion, stamp_ns: i64) -> Self {
        let [x_m, y_m, yaw_rad] = xy_yaw(&predicted.motion);
        Self {
            item: Item::recorded(0, last.item.scan, stamp_ns),
            x_m,
            y_m,
            yaw_rad,
            covariance: covariance::pack(&predicted.covariance),
            ahead_ns: stamp_ns - last.item.stamp_ns,
        }
    }
}

impl Header for PredictedPoseHeader {
    fn words(&self, _: &[u8]) -> String {
        let place = place(self.x_m, self.y_m, self.yaw_rad);
        format!(
            "{place}, {:.3} s after the last scan",
            self.ahead_ns as f64 * 1e-9
        )
    }
}

impl PoseHeader {
    /// Returns what poses after this one are predicted from.
    pub fn prediction_start(&self) -> PredictionStart {
        let motion = self.motion.motion();
        let interval_s = self.motion.interval_ns as f64 * 1e-9;
        let twist = match interval_s > 0.0 {
            true => Twist::from_chord(&motion.motion, interval_s),
            false => Twist::default(),
        };
        let learnt = |kind| {
            let record = self.motion.refinement.of(kind);
            record.is_used().then_some(LearntErrors {
                scale: record.scale,
                scale_sigma: record.scale_sigma,
                bias: record.bias,
                bias_sigma: record.bias_sigma,
            })
        };
        PredictionStart {
            stamp_ns: self.item.stamp_ns,
            pose: self.pose(),
            twist,
            interval_s,
            covariance: motion.covariance,
            gyro: learnt(Witness::Gyro),
            wheels: learnt(Witness::Wheels),
        }
    }
}
