//! The record of a refinement in the messages that carry a motion.

use bytemuck::{Pod, Zeroable};

use crate::check::{code, fields, finite};

pub mod outcome {
    /// The searched motion: there is no refinement, or the chain starts here.
    pub const SEARCHED: u32 = 0;
    pub const REFINED: u32 = 1;
    /// Refined with little support: the motion is used, but the scan does not enter the map.
    pub const WEAK: u32 = 2;
    /// No match: the motion is predicted from previous motions.
    pub const PREDICTED: u32 = 3;
}

pub mod initial_guess {
    pub const NONE: u32 = 0;
    /// The prediction at constant velocity.
    pub const PREDICTION: u32 = 1;
    pub const SEARCH: u32 = 2;
    /// The prediction with a yaw offset, tried when no other guess matched.
    pub const YAW_OFFSET: u32 = 3;
    /// The prediction, which determines the distance along walls without structure, since the radar
    /// does not.
    pub const ALONG_WALLS: u32 = 4;
}

pub mod gyro {
    /// It has not measured the turn.
    pub const NONE: u64 = 0;
    /// It agrees with the registered motion, or the motion is predicted with its turn.
    pub const USED: u64 = 1;
    /// It contradicts the registered motion, or has contradicted the last one: it is not used.
    pub const REFUSED: u64 = 2;
    /// It differs by more than noise from the registered motion, but not by more than a match can
    /// err: both are weighed all the same.
    pub const DOUBTED: u64 = 3;
}

pub mod wheels {
    /// They have not measured the distance.
    pub const NONE: u64 = 0;
    /// They agree with the registered motion, or the motion is predicted by them.
    pub const USED: u64 = 1;
    /// They slip: they disagree with the registered motion, or with the last one.
    pub const SLIP: u64 = 2;
}

pub mod doppler {
    /// One of both scans does not determine its velocity.
    pub const NONE: u64 = 0;
    /// It agrees with the registered motion, or the motion is predicted by it.
    pub const USED: u64 = 1;
    /// It contradicts the registered motion, or has contradicted the last one: it is not used.
    pub const REFUSED: u64 = 2;
}

/// The result of a refinement; all zero without one.
#[repr(C)]
#[derive(Clone, Copy, Debug, Default, PartialEq, Pod, Zeroable)]
pub struct RefinementRecord {
    pub outcome: u32,
    /// The initial guess of the accepted motion: see [`initial_guess`].
    pub initial_guess: u32,
    /// Mean value of the map at the scan's points, from 0 to 1; 1 if every keyframe has returns at
    /// all of them.
    pub overlap: f64,
    /// Weight of the scan's points relative to the running mean.
    pub support: f64,
    /// 1 while the vehicle stands, and its pose is held: the motion is zero. Otherwise 0.
    pub stationary: u64,
    pub gyro: u64,
    /// Turn since the previous scan that the gyro measured, rad; zero without one.
    pub gyro_turn_rad: f64,
    /// Scale of the gyro (true turn over measured turn) after the scan; zero without a gyro.
    pub gyro_scale: f64,
    /// Bias of the gyro after the scan, rad/s; zero without one.
    pub gyro_bias_radps: f64,
    pub gyro_bias_sigma_radps: f64,
    pub wheels: u64,
    /// Distance since the previous scan that the wheels measured, m; zero without wheels.
    pub wheel_distance_m: f64,
    /// True distance over the wheels' distance, after the scan; zero without wheels.
    pub wheel_scale: f64,
    pub wheel_scale_sigma: f64,
    pub doppler: u64,
    /// True velocity over that by Doppler, after the scan; zero without one.
    pub doppler_scale: f64,
    pub doppler_scale_sigma: f64,
}

impl RefinementRecord {
    pub fn is_stationary(&self) -> bool {
        self.stationary != 0
    }

    pub(crate) fn check(&self) -> Result<(), String> {
        code("outcome", self.outcome, outcome::PREDICTED)?;
        code(
            "initial_guess",
            self.initial_guess,
            initial_guess::ALONG_WALLS,
        )?;
        code("stationary", self.stationary, 1_u64)?;
        code("gyro", self.gyro, gyro::DOUBTED)?;
        code("wheels", self.wheels, wheels::SLIP)?;
        code("doppler", self.doppler, doppler::REFUSED)?;
        finite(fields![self;
            overlap support gyro_turn_rad gyro_scale gyro_bias_radps gyro_bias_sigma_radps
            wheel_distance_m wheel_scale wheel_scale_sigma doppler_scale doppler_scale_sigma
        ])
    }
}
