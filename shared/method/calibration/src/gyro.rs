//! The clock and the axes of a gyro, from the turns of the radar.
//!
//! Both turn together, so the log fits where the radar's turns correlate with it best: over all
//! three axes and all offsets of its clock, first coarsely, then by least squares for the offset,
//! the scale and the bias at once. The radar's turns come from the track, by radar alone.
//!
//! - `turns`: the radar's; `angles`: the gyro's, over any time;
//! - `search`: the axis and the coarse offset, and whether another pair fits about as well;
//! - `fit`: the least squares, with the jackknife over blocks of the drive;
//! - [`GyroCalibration`]: the findings; [`GyroError`]: why nothing was found.

pub(crate) mod angles;
mod error;
pub(crate) mod fit;
mod found;
pub(crate) mod search;
#[cfg(test)]
mod tests;
pub(crate) mod turns;

pub use error::GyroError;
pub use found::GyroCalibration;

use gyre_geometry::wrap_angle;
use gyre_samples::Sample;

use crate::{Drive, Estimate, Track};
use angles::Angles;
use turns::turns;

/// Offsets of the clocks that are looked at, s: UTC and GPS time are 18 s apart, UTC and TAI 37 s,
/// and the two clocks of a recording of RADIATE 64 s.
pub(crate) const MAX_LATE_S: f64 = 120.0;
/// Scales that a gyro can have: beyond, its unit is different.
const SCALES: std::ops::RangeInclusive<f64> = 0.9..=1.1;
/// Least standard deviation of the offset, periods of the gyro: its samples are interpolated.
const PERIOD_SHARE: f64 = 0.1;
/// Least standard deviation of the scale, from an axis that leans by 2.5 degrees.
const SCALE_SIGMA: f64 = 1e-3;
/// Least standard deviation of the bias, rad/s: a track turns spuriously if constants of the radar
/// are wrong.
const BIAS_SIGMA_RADPS: f64 = 1e-4;
/// An offset that is known less well is refused, s: at 10 degrees per second it is half a degree.
const MAX_LATE_SIGMA_S: f64 = 0.05;
const MAX_SCALE_SIGMA: f64 = 0.05;

/// Finds the offset, the axis, the scale and the bias of a gyro by a track of the drive.
///
/// Over `max_gap_s` without samples its rate is not interpolated.
pub fn calibrate_gyro(
    drive: &Drive,
    track: &Track,
    samples: &[Sample],
    max_gap_s: f64,
) -> Result<GyroCalibration, GyroError> {
    let stamps: Vec<i64> = drive.sweeps.iter().map(|sweep| sweep.stamp_ns).collect();
    let headings: Vec<f64> = track
        .poses
        .iter()
        .map(|pose| pose.rotation.angle())
        .collect();
    let starts: Vec<bool> = drive.sweeps.iter().map(|it| it.interval_s <= 0.0).collect();
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
) -> Result<GyroCalibration, GyroError> {
    let first_ns = stamps.first().copied().unwrap_or_default();
    let apart = headings
        .windows(2)
        .map(|pair| wrap_angle(pair[1] - pair[0]));
    let steps: Vec<f64> = std::iter::once(0.0).chain(apart).collect();
    let turns = turns(stamps, &steps, starts);
    let angles = Angles::new(samples, first_ns, max_gap_s);
    let begins_s = angles.span_s().map(|[first_s, _]| first_s);
    let peak = search::peak(&turns, &angles).map_err(|none| GyroError::of(none, begins_s))?;
    let fit = fit::Fit::new(&turns, &angles, &peak, true).ok_or(GyroError::Unsettled)?;
    let [scale, bias_radps, delay_s] = fit.parameters;
    let floored = |estimate: Estimate, floor: f64| Estimate {
        sigma: estimate.sigma.hypot(floor),
        ..estimate
    };
    let least_s = PERIOD_SHARE * angles.period_s();
    let delay_s = floored(delay_s, least_s);
    let span_s = turns.last().map_or(1.0, |turn| turn.to_s);
    let found = GyroCalibration {
        up: peak.up(),
        scale: floored(scale, SCALE_SIGMA),
        bias_radps: floored(bias_radps, BIAS_SIGMA_RADPS),
        delay_s,
        halves_s: fit.halves_s,
        drift: floored(fit.drift, least_s / span_s),
        correlation: peak.correlation.abs(),
        turns: fit.turns,
    };
    if !SCALES.contains(&scale.value) && (scale.value - 1.0).abs() > 3.0 * scale.sigma {
        return Err(GyroError::Scale { scale: scale.value });
    }
    match delay_s.sigma <= MAX_LATE_SIGMA_S && scale.sigma <= MAX_SCALE_SIGMA {
        true => Ok(found),
        false => Err(GyroError::Straight { delay_s, scale }),
    }
}
