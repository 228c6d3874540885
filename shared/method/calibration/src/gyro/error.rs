//! Why a drive does not determine the clock and the axes of a gyro.

use thiserror::Error;

use super::{
    MAX_LATE_S,
    search::{MIN_TURNS, NoPeak, Peak},
};
use crate::Estimate;

#[derive(Clone, Debug, PartialEq, Error)]
pub enum GyroError {
    #[error(
        "with offsets of the clocks up to {MAX_LATE_S:.0} s the log covers {turns} turns of a second, and {needed} are needed: {}",
        begins(*begins_s)
    )]
    Apart {
        /// Turns of the radar that the log has samples for, at most.
        turns: usize,
        /// Turns that are needed.
        needed: usize,
        /// From the first scan to the first sample, s.
        begins_s: Option<f64>,
    },
    #[error(
        "the gyro turns as the radar best {best}, but about as well {rival}: the drive is too straight or too short, its turns repeat, or the log is of another drive"
    )]
    Ambiguous {
        /// The best offset and axis.
        best: Candidate,
        rival: Candidate,
    },
    #[error(
        "the offset of the clocks is not determined: parts of the drive lead to different ones"
    )]
    Unsettled,
    #[error(
        "the offset of the clocks is {:.2} \u{b1} {:.2} s and the scale {:.2} \u{b1} {:.2}, which is too uncertain to be used: the drive turns too little, or a clock drifts",
        delay_s.value, delay_s.sigma, scale.value, scale.sigma
    )]
    Straight {
        /// The offset, s.
        delay_s: Estimate,
        scale: Estimate,
    },
    #[error(
        "the radar turns {scale:.4} times as much as the gyro measures: {}",
        unit(*scale)
    )]
    Scale { scale: f64 },
    #[error(
        "one drive says that {one} points up, another that {other} does: these are not logs of one gyro as it is mounted"
    )]
    Axes {
        /// The axis of one drive.
        one: &'static str,
        /// The axis of the other drive.
        other: &'static str,
    },
}

impl GyroError {
    /// `begins_s`: from the first scan to the first sample, s.
    pub(super) fn of(none: NoPeak, begins_s: Option<f64>) -> Self {
        match none {
            NoPeak::Apart { turns } => Self::Apart {
                turns,
                needed: MIN_TURNS,
                begins_s,
            },
            NoPeak::Ambiguous { best, rival } => Self::Ambiguous {
                best: best.into(),
                rival: rival.into(),
            },
        }
    }
}

/// An offset with an axis.
#[derive(Clone, Copy, Debug, PartialEq, Error)]
#[error("about {axis} with delay_s = {delay_s:.2} (correlation {correlation:.2})")]
pub struct Candidate {
    /// The axis that points up.
    pub axis: &'static str,
    /// The offset, s.
    pub delay_s: f64,
    pub correlation: f64,
}

impl From<Peak> for Candidate {
    fn from(peak: Peak) -> Self {
        Self {
            axis: peak.up().name(),
            delay_s: peak.delay_s,
            correlation: peak.correlation.abs(),
        }
    }
}

fn begins(begins_s: Option<f64>) -> String {
    match begins_s {
        Some(begins_s) if begins_s.abs() > MAX_LATE_S => format!(
            "it begins {begins_s:.0} s after the first scan; is it of another drive, or its clock set otherwise? Then correct its stamps first"
        ),
        _ => "the drive is too short, or most samples are missing".to_owned(),
    }
}

fn unit(scale: f64) -> &'static str {
    let is_degree = (scale / 1f64.to_radians() - 1.0).abs() < 0.1;
    match is_degree {
        true => "its rates are in deg/s, name the columns so, as gyro_z_degps",
        false => "its rates have another unit, or none of its axes points up",
    }
}
