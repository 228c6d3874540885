//! The clock and the axes of a gyro, from the turns of the radar's track: the log fits where they
//! correlate best, over all three axes and all offsets of its clock, first coarsely, then by least
//! squares for the offset, the scale and the bias at once.

pub(crate) mod angles;
pub(crate) mod fit;
mod found;
pub(crate) mod search;
#[cfg(test)]
mod tests;
pub(crate) mod turns;

pub use found::GyroCalibration;
pub(crate) use found::log_keys;

use angles::Angles;
use fit::Fit;
use gyre_geometry::{samples::Sample, wrap_angle};
use search::{MIN_TURNS, NoPeak};
use thiserror::Error;
use turns::turns;

use crate::{Drive, Track};

/// Offsets of the clocks that are looked at, s: UTC and GPS time are 18 s apart, UTC and TAI 37 s,
/// and the two clocks of a recording of RADIATE 64 s.
pub(crate) const MAX_LATE_S: f64 = 120.0;
/// Scales that a gyro can have: beyond, its unit is different.
const SCALES: std::ops::RangeInclusive<f64> = 0.9..=1.1;
/// Least standard deviation of the offset, periods of the log: its samples are interpolated.
pub(crate) const PERIOD_SHARE: f64 = 0.1;
/// Least standard deviation of the scale, from an axis that leans by 2.5 degrees.
const SCALE_SIGMA: f64 = 1e-3;
/// Least standard deviation of the bias, rad/s: a track turns spuriously if constants of the radar
/// are wrong.
const BIAS_SIGMA_RADPS: f64 = 1e-4;
/// An offset that is known less well is refused, s: at 10 degrees per second it is half a degree.
const MAX_LATE_SIGMA_S: f64 = 0.05;
const MAX_SCALE_SIGMA: f64 = 0.05;

/// Why a drive does not determine the clock of a gyro or of the wheels.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{0}")]
pub struct ClockError(pub(crate) String);

impl ClockError {
    pub(crate) fn unsettled() -> Self {
        let reason =
            "the offset of the clocks is not determined: parts of the drive lead to different ones";
        Self(reason.to_owned())
    }
}

/// Finds the offset, the axis, the scale and the bias of a gyro by a track of the drive.
/// Over `max_gap_s` without samples its rate is not interpolated.
pub fn calibrate_gyro(
    drive: &Drive,
    track: &Track,
    samples: &[Sample],
    max_gap_s: f64,
) -> Result<GyroCalibration, ClockError> {
    let headings = track.poses.iter().map(|pose| pose.rotation.angle());
    let headings: Vec<f64> = headings.collect();
    let (stamps, starts) = drive.stamps();
    calibrate_turns(&stamps, &headings, &starts, samples, max_gap_s)
}

/// As [`calibrate_gyro`], from the headings of the scans, counter-clockwise; `starts` marks where
/// the chain of motions restarts.
pub(crate) fn calibrate_turns(
    stamps: &[i64],
    headings: &[f64],
    starts: &[bool],
    samples: &[Sample],
    max_gap_s: f64,
) -> Result<GyroCalibration, ClockError> {
    let first_ns = stamps.first().copied().unwrap_or_default();
    let apart = headings.windows(2);
    let apart = apart.map(|pair| wrap_angle(pair[1] - pair[0]));
    let steps: Vec<f64> = std::iter::once(0.0).chain(apart).collect();
    let turns = turns(stamps, &steps, starts);
    let angles = Angles::new(samples, first_ns, max_gap_s);
    let peak = search::peak(&turns, &angles).map_err(|none| refusal(none, &angles))?;
    let fit = Fit::new(&turns, &angles, &peak, true).ok_or_else(ClockError::unsettled)?;
    let [scale, bias_radps, delay_s] = fit.parameters;
    let least_s = PERIOD_SHARE * angles.period_s();
    let delay_s = delay_s.with_error(least_s);
    let span_s = turns.last().map_or(1.0, |turn| turn.to_s);
    let found = GyroCalibration {
        up: peak.up(),
        scale: scale.with_error(SCALE_SIGMA),
        bias_radps: bias_radps.with_error(BIAS_SIGMA_RADPS),
        delay_s,
        drift: fit.drift.with_error(least_s / span_s),
        correlation: peak.correlation.abs(),
        turns: fit.turns,
    };
    if !SCALES.contains(&scale.value) && (scale.value - 1.0).abs() > 3.0 * scale.sigma {
        let is_degree = (scale.value / 1f64.to_radians() - 1.0).abs() < 0.1;
        let unit = match is_degree {
            true => "its rates are in deg/s, name the columns so, as gyro_z_degps",
            false => "its rates have another unit, or none of its axes points up",
        };
        return Err(ClockError(format!(
            "the radar turns {:.4} times as much as the gyro measures: {unit}",
            scale.value
        )));
    }
    match delay_s.sigma <= MAX_LATE_SIGMA_S && scale.sigma <= MAX_SCALE_SIGMA {
        true => Ok(found),
        false => Err(ClockError(format!(
            "the offset of the clocks is {delay_s:.2} s and the scale {scale:.2}, which is too uncertain to be used: the drive turns too little, or a clock drifts",
        ))),
    }
}

fn refusal(none: NoPeak, angles: &Angles) -> ClockError {
    ClockError(match none {
        NoPeak::Apart { turns } => {
            let begins_s = angles
                .begins_s()
                .filter(|begins_s| begins_s.abs() > MAX_LATE_S);
            let why = begins_s.map_or("the drive is too short, or most samples are missing".to_owned(), |begins_s| format!(
                "it begins {begins_s:.0} s after the first scan; is it of a different drive, or its clock set otherwise? Then correct its stamps first"
            ));
            format!(
                "with offsets of the clocks up to {MAX_LATE_S:.0} s the log covers {turns} turns of a second, and {MIN_TURNS} are needed: {why}"
            )
        }
        NoPeak::Ambiguous { best, rival } => {
            let [best, rival] = [best, rival].map(|it| {
                let (axis, correlation) = (it.up().name(), it.correlation.abs());
                format!(
                    "about {axis} with delay_s = {:.2} (correlation {correlation:.2})",
                    it.delay_s
                )
            });
            format!(
                "the gyro turns as the radar best {best}, but about as well {rival}: the drive is too straight or too short, its turns repeat, or the log is of a different drive"
            )
        }
    })
}
