//! The clock and the scale of the wheels, from the distances that the radar drives.

use std::path::Path;

use gyre_geometry::samples::{Sample, WheelsConfig};

use crate::{
    Drive, Estimate, Track,
    gyro::{
        ClockError, MAX_LATE_S, PERIOD_SHARE,
        angles::Angles,
        fit::Fit,
        log_keys,
        search::{MIN_TURNS, NoPeak, peak},
        turns::turns,
    },
};

/// Least standard deviation of the scale: the radar's own, and tyres that warm.
const SCALE_SIGMA: f64 = 2e-3;
/// An offset that is known less well is refused, s: while braking at 5 m/s² it is half a m/s.
const MAX_LATE_SIGMA_S: f64 = 0.1;
/// Scales that wheels can have: beyond, their unit is different.
const SCALES: std::ops::RangeInclusive<f64> = 0.8..=1.25;

/// The clock and the scale of the wheels, by the distances of the radar.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WheelCalibration {
    pub delay_s: Estimate,
    /// True distance over the measured one.
    pub scale: Estimate,
    pub correlation: f64,
    /// Number of distances that were compared, of a second each.
    pub distances: usize,
}

/// Finds the offset and the scale of the wheels by a track of the drive.
/// Over `max_gap_s` without samples their speed is not interpolated.
pub fn calibrate_wheels(
    drive: &Drive,
    track: &Track,
    samples: &[Sample],
    max_gap_s: f64,
) -> Result<WheelCalibration, ClockError> {
    let driven = track.motions.iter().map(|it| it.motion.translation.x);
    let driven: Vec<f64> = driven.collect();
    let (stamps, starts) = drive.stamps();
    calibrate_distances(&stamps, &driven, &starts, samples, max_gap_s)
}

/// As [`calibrate_wheels`], from the distances since the scans before, m.
fn calibrate_distances(
    stamps: &[i64],
    driven_m: &[f64],
    starts: &[bool],
    samples: &[Sample],
    max_gap_s: f64,
) -> Result<WheelCalibration, ClockError> {
    let first_ns = stamps.first().copied().unwrap_or_default();
    let distances = turns(stamps, driven_m, starts);
    let log = Angles::new(samples, first_ns, max_gap_s);
    let peak = peak(&distances, &log).map_err(refusal)?;
    let fit = Fit::new(&distances, &log, &peak, false).ok_or_else(ClockError::unsettled)?;
    let [scale, _, delay_s] = fit.parameters;
    let delay_s = delay_s.with_error(PERIOD_SHARE * log.period_s());
    if !SCALES.contains(&scale.value) {
        return Err(ClockError(format!(
            "the radar drives {:.3} times as far as the wheels measure: their speeds have another unit (0.278 is km/h, 0.447 mph)",
            scale.value
        )));
    }
    match delay_s.sigma <= MAX_LATE_SIGMA_S {
        true => Ok(WheelCalibration {
            delay_s,
            scale: scale.with_error(SCALE_SIGMA),
            correlation: peak.correlation,
            distances: fit.turns,
        }),
        false => Err(ClockError(format!(
            "the offset of the clocks is {delay_s:.2} s, which is too uncertain to be used: the speed changes too little, or a clock drifts",
        ))),
    }
}

fn refusal(none: NoPeak) -> ClockError {
    ClockError(match none {
        NoPeak::Apart { turns } => format!(
            "with offsets of the clocks up to {MAX_LATE_S:.0} s the log covers {turns} distances of a second, and {MIN_TURNS} are needed: the drive is too short, or the log is of another one"
        ),
        NoPeak::Ambiguous { best, rival } => format!(
            "the wheels drive as the radar best with delay_s = {:.2} (correlation {:.2}), but about as well with {:.2} ({:.2}): the speed changes too little, or the log is of a different drive",
            best.delay_s, best.correlation, rival.delay_s, rival.correlation
        ),
    })
}

impl WheelCalibration {
    /// Returns the mean over drives of one vehicle, each weighted by its uncertainty.
    #[must_use]
    pub fn mean(&self, others: &[Self]) -> Self {
        others.iter().fold(*self, |mean, other| Self {
            delay_s: mean.delay_s.combined(&other.delay_s),
            scale: mean.scale.combined(&other.scale),
            correlation: mean.correlation.min(other.correlation),
            distances: mean.distances + other.distances,
        })
    }

    /// Returns the section `[wheels]`, with the log if it does not lie beside the scans, and the
    /// distance of a tick that the scale is of.
    pub fn toml(&self, file: Option<&Path>, m_per_tick: Option<f64>) -> String {
        let tick = m_per_tick.map(|metres| format!("m_per_tick = {metres}\n"));
        let tick = tick.unwrap_or_default();
        let kind = log_keys(file);
        let (late, scale) = (self.delay_s, self.scale);
        format!(
            "\n[wheels]\n{kind}{tick}delay_s = {:.4}\ntime_sigma_s = {:.4}\nscale = {:.4}\nscale_sigma = {:.4} # correlation {:.3} of {} distances with those of the radar\n",
            late.value,
            late.sigma.max(1e-4),
            scale.value,
            scale.sigma,
            self.correlation,
            self.distances
        )
    }

    pub fn table(&self, configured: &WheelsConfig) -> String {
        let line = |name: &str, found: &Estimate, unit: &str, value: f64| {
            let verdict = found.verdict(configured.is_used().then_some(value));
            format!("{name:<21} {found}{unit}{verdict}")
        };
        let (late, scale) = (&self.delay_s, &self.scale);
        [
            line("wheels, late by", late, " s", configured.delay_s),
            line("wheels, scale", scale, "", configured.scale),
            format!(
                "{:<21} {} distances of a second, correlation {:.4}",
                "", self.distances, self.correlation
            ),
        ]
        .join("\n")
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    const START_NS: i64 = 1_549_986_607_000_000_000;
    const SECONDS: i64 = 120;

    fn speed(time_s: f64, seed: f64) -> f64 {
        let waves = (1..7).map(|k| {
            // Without a common period, after which other offsets would fit as well.
            let pace = 0.07 * f64::from(k) + 0.0031 * f64::from(k * k) + 0.013 * seed;
            (pace * time_s + seed * f64::from(k * k)).sin() / f64::from(k)
        });
        8.0 + 3.0 * waves.sum::<f64>()
    }

    /// The distances of a radar at 4 Hz, whose noise is a centimetre, and its stamps.
    fn radar(seed: f64) -> (Vec<i64>, Vec<f64>) {
        let at = |k: i64| 0.25 * k as f64;
        let stamps = (0..4 * SECONDS).map(|k| START_NS + 250_000_000 * k);
        let driven = (0..4 * SECONDS).map(|k| {
            let steps = (0..25).map(|part| 0.01 * speed(at(k - 1) + 0.01 * part as f64, seed));
            steps.sum::<f64>() + 0.01 * (k as f64 * 1.7).sin()
        });
        (stamps.collect(), driven.collect())
    }

    fn wheels(seed: f64, delay_s: f64, scale: f64) -> Vec<Sample> {
        let samples = (-200 * 20..(SECONDS + 200) * 20).map(|k| {
            let time_s = 0.05 * k as f64;
            let stamp_ns = START_NS + ((time_s + delay_s) * 1e9) as i64;
            Sample::speed(stamp_ns, speed(time_s, seed) / scale)
        });
        samples.collect()
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(12))]

        /// Whatever the offset and the scale, they are found within their uncertainties.
        #[test]
        fn clock_and_scale_are_found(
            delay_s in -60.0..60.0f64, scale in 0.95..1.05f64, seed in 1.0..9.0f64,
        ) {
            let (stamps, driven) = radar(seed);
            let starts = vec![false; stamps.len()];
            let log = wheels(seed, delay_s, scale);
            let found = calibrate_distances(&stamps, &driven, &starts, &log, 0.25).unwrap();
            let late = found.delay_s;
            prop_assert!((late.value - delay_s).abs() < 4.0 * late.sigma, "{late:?} {delay_s}");
            prop_assert!((found.scale.value - scale).abs() < 4.0 * found.scale.sigma);
            prop_assert!(late.sigma < 0.05 && found.scale.sigma < 0.01, "{found:?}");
        }
    }

    #[test]
    fn another_drive_another_unit_and_a_steady_speed_are_refused() {
        let (stamps, driven) = radar(1.0);
        let starts = vec![false; stamps.len()];
        let refused = |driven: &[f64], log: &[Sample], expected: &[&str]| {
            let found = calibrate_distances(&stamps, driven, &starts, log, 0.25);
            let reason = found.unwrap_err().to_string();
            let is_said = expected.iter().any(|it| reason.contains(it));
            assert!(is_said, "{reason}");
        };
        let in_km_h = wheels(1.0, 0.5, 1.0 / 3.6);
        refused(&driven, &in_km_h, &["the radar drives 0.27"]);
        let steady = vec![2.5; driven.len()];
        let mut log = wheels(1.0, 0.0, 1.0);
        for sample in &mut log {
            *sample = Sample::speed(sample.stamp_ns, 10.0);
        }
        refused(&steady, &log, &["but about as well with"]);
        let other = ["the speed changes", "parts of the drive"];
        refused(&driven, &wheels(5.0, 0.0, 1.0), &other);
        refused(&driven, &wheels(1.0, 3600.0, 1.0), &["the log covers"]);
    }
}
