//! The record of a refinement in the messages that carry a motion.

use gyre_geometry::samples::{Measures, Witness};

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

    /// The verdict on a measurement of a sensor beside the radar.
    pub mod verdict: u64 {
        /// It has not measured the motion.
        NONE = "none",
        /// It agrees with the registered motion, or the motion is predicted by it.
        USED = "used",
        /// It contradicts the registered motion, or has contradicted the last one: it is not used.
        /// Wheels slip.
        REFUSED = "refused",
        /// It differs by more than noise from the registered motion, but not by more than a match
        /// can err: the motion has the part of the sensor, and the next match decides.
        DOUBTED = "doubted",
    }
}

wire! {
    /// A sensor beside the radar in a motion; all zero if it has not measured the motion.
    pub struct WitnessRecord = "gyre_witness_record_v2" {
        /// See [`verdict`].
        pub verdict: u64 [Bounds::Codes(verdict::NAMES)],
        /// The turn (rad) or the distance (m) since the previous scan that it measured, or the
        /// heading (rad).
        pub measured: f64 [Bounds::Finite],
        /// The same turn or distance by the registration alone; zero without a match.
        pub registered: f64 [Bounds::Finite],
        /// The true value over the measured one, after the scan.
        pub scale: f64 [Bounds::Finite],
        pub scale_sigma: f64 [Bounds::Finite],
        /// Bias after the scan, rad/s; the offset of an absolute heading, rad; zero of a distance.
        pub bias: f64 [Bounds::Finite],
        pub bias_sigma: f64 [Bounds::Finite],
    }

    /// The result of a refinement; all zero without one.
    pub struct RefinementRecord = "gyre_refinement_v8" {
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
        /// Gyro, wheels, Doppler and absolute heading.
        pub witnesses: [WitnessRecord; Witness::ALL.len()],
    }
}

/// The names of 0 and 1.
pub(crate) const NO_YES: &[&str] = &["no", "yes"];

impl RefinementRecord {
    pub fn is_stationary(&self) -> bool {
        self.stationary != 0
    }

    pub fn of(&self, kind: Witness) -> &WitnessRecord {
        &self.witnesses[kind as usize]
    }

    pub fn of_mut(&mut self, kind: Witness) -> &mut WitnessRecord {
        &mut self.witnesses[kind as usize]
    }

    /// Returns the kind whose distance the motion uses.
    pub fn distance_by(&self) -> Option<Witness> {
        let mut kinds = Witness::ALL.into_iter();
        kinds.find(|it| it.row().measures == Measures::Distance && self.of(*it).is_used())
    }
}

impl WitnessRecord {
    pub fn is_used(&self) -> bool {
        [verdict::USED, verdict::DOUBTED].contains(&self.verdict)
    }

    /// Returns the measurement; `None` if the sensor has not measured the motion.
    pub fn measured(&self) -> Option<f64> {
        (self.verdict != verdict::NONE).then_some(self.measured)
    }
}
