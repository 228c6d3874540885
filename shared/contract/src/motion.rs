//! `rotation`, `motion` and `refined`: the motion of the vehicle between two scans.

use gyre_geometry::{MAX_INTERVAL_NS, OdometryMotion, Twist, covariance, pose};

use crate::{
    item::Item,
    message::Header,
    refinement::RefinementRecord,
    wire::{Bounds, wire},
};

/// The search stays within one width of the raster; a prediction over a gap may be longer.
const WIDTHS: Bounds = Bounds::Widths(10.0);
const SHARE: Bounds = Bounds::Within(0.0, 1.0);

wire! {
    pub struct RotationEstimate = "gyre_rotation_estimate_v1" {
        /// Yaw of this scan's frame in the previous scan's frame, rad, counter-clockwise.
        pub angle_rad: f64 [Bounds::HalfTurn],
        /// Variance from the shape of the peak, rad^2.
        pub variance_rad2: f64 [Bounds::NotNegative],
        /// Height of the correlation peak, at most 1.
        pub score: f64 [Bounds::Finite],
        /// Angle, rad, and height of the second highest peak.
        pub runner_up_rad: f64 [Bounds::HalfTurn],
        pub runner_up_score: f64 [Bounds::Finite],
    }

    pub struct RotationHeader = "gyre_rotation_header_v6" {
        pub item: Item,
        /// The rotation; all zero where the chain starts.
        pub rotation: RotationEstimate,
    }

    /// The pose of this scan's frame in the previous scan's frame, with its covariance: x forward,
    /// y to the left, yaw counter-clockwise.
    pub struct MotionEstimate = "gyre_motion_estimate_v10" {
        pub x_m: f64 [WIDTHS],
        pub y_m: f64 [WIDTHS],
        pub yaw_rad: f64 [Bounds::HalfTurn],
        pub covariance: covariance::Packed [Bounds::Covariance],
        /// Share of the covariance that is drift, 0 to 1: see [`OdometryMotion::drift_share`].
        pub drift_share: f64 [SHARE],
        /// Standard deviation of the scale that all motions share: see
        /// [`OdometryMotion::scale_sigma`].
        pub scale_sigma: f64 [SHARE],
        /// Time between the two scans, ns on the sensor's clock.
        pub interval_ns: i64 [Bounds::Within(0.0, MAX_INTERVAL_NS as f64)],
        /// Height of the correlation peak of the translation, at most 1.
        pub score: f64 [Bounds::Finite],
        pub runner_up_score: f64 [Bounds::Finite],
        pub rotation: RotationEstimate,
        /// The searched motion: x, y (m), yaw (rad). It is the same on every topic, because motion
        /// compensation uses it.
        pub searched: [f64; 3] [Bounds::Motion],
        pub refinement: RefinementRecord,
    }

    pub struct MotionHeader = "gyre_motion_header_v13" {
        pub item: Item,
        /// The motion; all zero where the chain starts.
        pub motion: MotionEstimate,
    }
}

impl Header for RotationHeader {
    fn words(&self, _: &[u8]) -> String {
        let (yaw_deg, score) = (self.rotation.angle_rad.to_degrees(), self.rotation.score);
        format!("yaw {yaw_deg:.3} deg, score {score:.3}")
    }
}

impl Header for MotionHeader {
    fn words(&self, _: &[u8]) -> String {
        let motion = &self.motion;
        let place = place(motion.x_m, motion.y_m, motion.yaw_rad);
        format!("{place}, score {:.3}{}", motion.score, motion.standing())
    }
}

/// Returns a pose for a person.
pub(crate) fn place(x_m: f64, y_m: f64, yaw_rad: f64) -> String {
    let yaw_deg = yaw_rad.to_degrees();
    format!("x {x_m:.3} m, y {y_m:.3} m, yaw {yaw_deg:.3} deg")
}

impl MotionEstimate {
    pub(crate) fn standing(&self) -> &'static str {
        match self.refinement.is_stationary() {
            true => ", stationary",
            false => "",
        }
    }

    pub fn motion(&self) -> OdometryMotion {
        OdometryMotion {
            motion: pose(self.x_m, self.y_m, self.yaw_rad),
            covariance: covariance::unpack(&self.covariance),
            drift_share: self.drift_share,
            scale_sigma: self.scale_sigma,
        }
    }

    /// Returns the constant velocity of the searched motion. It is the same whether masking reads
    /// it from `motion` or from `pose` after refinement.
    pub fn searched_twist(&self) -> Twist {
        let [x_m, y_m, yaw_rad] = self.searched;
        let interval_s = self.interval_ns as f64 * 1e-9;
        Twist::from_motion(&pose(x_m, y_m, yaw_rad), interval_s)
    }
}
