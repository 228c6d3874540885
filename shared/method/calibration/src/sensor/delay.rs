//! The delay and the scale of a sensor against the radar, from the motions of a run.

use gyre_geometry::samples::Sample;
use gyre_radar::median;

use super::{
    fit::Fit,
    log::{Log, Step, stretches},
    search::Search,
};
use crate::Estimate;

/// The turn or the distance from one scan to the next, by the radar alone and by another sensor.
#[derive(Clone, Copy, Debug)]
pub struct Compared {
    pub stamp_ns: i64,
    pub interval_ns: i64,
    /// By the radar, rad or m; `None` where it does not measure it.
    pub radar: Option<f64>,
    /// By the other sensor; `None` where it does not.
    pub other: Option<f64>,
}

/// Estimates the delay of the stamps of the other sensor, s, and its scale, the true value over the
/// measured one. The delay is the smallest that fits the measurements about as well as the best
/// one. `None` where they do not determine it. Speeds have no bias: `has_bias` is for rates.
pub fn compare(motions: &[Compared], has_bias: bool) -> Option<[Estimate; 2]> {
    let first_ns = motions.first()?.stamp_ns;
    let steps: Vec<Step> = motions.iter().map(|it| (it.stamp_ns, it.radar)).collect();
    let sample = |it: &Compared| {
        let rate = it.other? / (it.interval_ns as f64 * 1e-9);
        let middle_ns = it.stamp_ns - it.interval_ns / 2;
        rate.is_finite().then(|| Sample::speed(middle_ns, rate))
    };
    let samples: Vec<Sample> = motions.iter().filter_map(sample).collect();
    let interval_s = median(motions.iter().map(|it| it.interval_ns as f64 * 1e-9))?;
    let log = Log::new(&samples, first_ns, 1.5 * interval_s);
    let stretches = stretches(&steps);
    let peak = Search::new(&stretches, &log, 1).nearest()?;
    let [scale, _, delay_s] = Fit::new(&stretches, &log, &peak, has_bias)?.parameters;
    // Rates are means over an interval: right gyros are late by up to 0.01 of one on eight drives,
    // right wheels by 0.06.
    Some([
        delay_s.with_error(0.05 * interval_s),
        scale.with_error(0.005),
    ])
}
