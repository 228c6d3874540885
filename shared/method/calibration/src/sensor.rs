//! The clock of a sensor beside the radar, its axis, scale and bias, from the motions of the
//! radar's track: its log fits where both correlate best, over all axes and all offsets of its
//! clock, first coarsely, then by least squares for the offset, the scale and the bias at once.

mod delay;
mod fit;
mod found;
pub mod kinds;
mod log;
mod search;
#[cfg(test)]
mod tests;

pub use delay::{Compared, compare};
pub use found::{SensorCalibration, SensorSettings};
pub use kinds::Kind;

use fit::Fit;
use gyre_geometry::samples::Sample;
use log::{Log, Step, stretches};
use search::Search;
use thiserror::Error;

use crate::{Drive, Track};

/// Least standard deviation of the offset, periods of the log: its samples are interpolated.
const PERIOD_SHARE: f64 = 0.1;

/// Why a drive does not determine the clock of a sensor.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("{0}")]
pub struct ClockError(String);

/// Finds the offset, the axis, the scale and the bias of a sensor by a track of the drive.
/// Over `max_gap_s` without samples its measurement is not interpolated.
pub fn calibrate_sensor(
    kind: &'static Kind,
    drive: &Drive,
    track: &Track,
    samples: &[Sample],
    max_gap_s: f64,
) -> Result<SensorCalibration, ClockError> {
    let step = |later: usize| {
        let earlier = later.checked_sub(1)?;
        (!track.is_broken(earlier, later)).then(|| (kind.step)(track, earlier, later))
    };
    let stamps = drive.sweeps.iter().map(|sweep| sweep.stamp_ns);
    let steps = stamps.enumerate().map(|(k, stamp_ns)| (stamp_ns, step(k)));
    calibrate_steps(kind, &steps.collect::<Vec<_>>(), samples, max_gap_s)
}

/// As [`calibrate_sensor`], from the turns or distances by the radar.
fn calibrate_steps(
    kind: &'static Kind,
    steps: &[Step],
    samples: &[Sample],
    max_gap_s: f64,
) -> Result<SensorCalibration, ClockError> {
    let first_ns = steps.first().map_or(0, |step| step.0);
    let stretches = stretches(steps);
    let log = Log::new(samples, first_ns, max_gap_s);
    let peak = Search::new(&stretches, &log, kind.axes).best(kind)?;
    let fit = Fit::new(&stretches, &log, &peak, kind.has_bias).ok_or_else(|| {
        let reason =
            "the offset of the clocks is not determined: parts of the drive lead to different ones";
        ClockError(reason.to_owned())
    })?;
    let [scale, bias, delay_s] = fit.parameters;
    let least_s = PERIOD_SHARE * log.period_s();
    let delay_s = delay_s.with_error(least_s);
    let is_beyond = (scale.value - 1.0).abs() > kind.unit_sigmas * scale.sigma;
    if is_beyond && !kind.scales.contains(&scale.value) {
        return Err(ClockError((kind.wrong_unit)(scale.value)));
    }
    if !(delay_s.sigma <= kind.max_delay_sigma_s && scale.sigma <= kind.max_scale_sigma) {
        let and_scale = match kind.max_scale_sigma.is_finite() {
            true => format!(" and the scale {scale:.2}"),
            false => String::new(),
        };
        return Err(ClockError(format!(
            "the offset of the clocks is {delay_s:.2} s{and_scale}, which is too uncertain to be used: {}, or a clock drifts",
            kind.steady
        )));
    }
    let span_s = stretches.last().map_or(1.0, |it| it.to_s);
    let up = (kind.axes > 1).then(|| peak.up());
    Ok(SensorCalibration {
        kind,
        up,
        scale: scale.with_error(kind.least_scale_sigma),
        bias: bias.with_error(kind.least_bias_sigma),
        delay_s,
        drift: fit.drift.with_error(least_s / span_s),
        // An axis that points down is one that points up with the other sign.
        correlation: up.map_or(peak.correlation, |_| peak.correlation.abs()),
        count: fit.count,
    })
}
