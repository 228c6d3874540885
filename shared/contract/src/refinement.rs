//! The record of a refinement in the messages that carry a motion.

use crate::wire::{Bounds, codes, wire};

codes! {
    pub mod outcome: u32 {
        /// The searched motion: there is no refinement, or the chain starts here.
        SEARCHED = "searched",
        REFINED = "refined",
        /// Refined with little support: the motion is used, but the scan does not enter the map.
        WEAK = "weak",
        /// No match: the motion is predicted from previous motions.
        PREDICTED = "predicted",
    }

    pub mod initial_guess: u32 {
        NONE = "none",
        /// The prediction at constant velocity.
        PREDICTION = "prediction",
        SEARCH = "search",
        /// The prediction with a yaw offset, tried when no other guess matched.
        YAW_OFFSET = "yaw-offset",
        /// The prediction, which determines the distance along walls without structure, since the
        /// radar does not.
        ALONG_WALLS = "along-walls",
    }

    pub mod gyro: u64 {
        /// It has not measured the turn.
        NONE = "none",
        /// It agrees with the registered motion, or the motion is predicted with its turn.
        USED = "used",
        /// It contradicts the registered motion, or has contradicted the last one: it is not used.
        REFUSED = "refused",
        /// It differs by more than noise from the registered motion, but not by more than a match
        /// can err: both are weighed all the same.
        DOUBTED = "doubted",
    }

    pub mod wheels: u64 {
        /// They have not measured the distance.
        NONE = "none",
        /// They agree with the registered motion, or the motion is predicted by them.
        USED = "used",
        /// They slip: they disagree with the registered motion, or with the last one.
        SLIP = "slip",
    }

    pub mod doppler: u64 {
        /// One of both scans does not determine its velocity.
        NONE = "none",
        /// It agrees with the registered motion, or the motion is predicted by it.
        USED = "used",
        /// It contradicts the registered motion, or has contradicted the last one: it is not used.
        REFUSED = "refused",
    }
}

wire! {
    /// The result of a refinement; all zero without one.
    pub struct RefinementRecord = "gyre_refinement_v6" {
        /// See [`outcome`].
        pub outcome: u32 [Bounds::Codes(outcome::NAMES)],
        /// The initial guess of the accepted motion: see [`initial_guess`].
        pub initial_guess: u32 [Bounds::Codes(initial_guess::NAMES)],
        /// Mean value of the map at the scan's points, from 0 to 1; 1 if every keyframe has returns
        /// at all of them.
        pub overlap: f64 [Bounds::Finite],
        /// Weight of the scan's points relative to the running mean.
        pub support: f64 [Bounds::Finite],
        /// 1 while the vehicle stands, and its pose is held: the motion is zero. Otherwise 0.
        pub stationary: u64 [Bounds::Codes(NO_YES)],
        pub gyro: u64 [Bounds::Codes(gyro::NAMES)],
        /// Turn since the previous scan that the gyro measured, rad; zero without one.
        pub gyro_turn_rad: f64 [Bounds::Finite],
        /// Scale of the gyro (true turn over measured turn) after the scan; zero without a gyro.
        pub gyro_scale: f64 [Bounds::Finite],
        /// Bias of the gyro after the scan, rad/s; zero without one.
        pub gyro_bias_radps: f64 [Bounds::Finite],
        pub gyro_bias_sigma_radps: f64 [Bounds::Finite],
        pub wheels: u64 [Bounds::Codes(wheels::NAMES)],
        /// Distance since the previous scan that the wheels measured, m; zero without wheels.
        pub wheel_distance_m: f64 [Bounds::Finite],
        /// True distance over the wheels' distance, after the scan; zero without wheels.
        pub wheel_scale: f64 [Bounds::Finite],
        pub wheel_scale_sigma: f64 [Bounds::Finite],
        pub doppler: u64 [Bounds::Codes(doppler::NAMES)],
        /// True velocity over that by Doppler, after the scan; zero without one.
        pub doppler_scale: f64 [Bounds::Finite],
        pub doppler_scale_sigma: f64 [Bounds::Finite],
    }
}

/// The names of 0 and 1.
pub(crate) const NO_YES: &[&str] = &["no", "yes"];

impl RefinementRecord {
    pub fn is_stationary(&self) -> bool {
        self.stationary != 0
    }
}
