use std::fmt::Write as _;

use gyre_geometry::{Twist, samples::Sample};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

use crate::{
    path::Path,
    stream::{Episodes, Stream},
};

pub(crate) const FILE: &str = "wheels.csv";
const HEADER: &str = "stamp_ns,speed_m_s";

/// Standard deviation of the scale, a share: tyres are a percent off.
const SCALE_SIGMA: f64 = 0.01;
/// Noise of the distance, m/√m: tyres creep, and the road is not even.
const CREEP_M_PER_SQRT_M: f64 = 0.01;
/// Standard deviation of each sample, and its step, m/s: a hundredth of a km/h.
const NOISE_MPS: f64 = 0.02;
const STEP_MPS: f64 = 0.01 / 3.6;
/// Time between slips and their duration, s; excess speed of the wheels, a share.
const SLIP_EVERY_S: f64 = 4.0;
const SLIP_S: f64 = 0.5;
const SLIP_SHARE: f64 = 0.3;
const LOST: f64 = 0.02;

/// The speed of the wheels of the axle that does not steer, below the radar.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SimulatedWheelsConfig {
    /// Samples a second. Default: 0, no wheels, and then the other keys have no effect.
    pub rate_hz: f64,
    /// Delay of the stamps against the radar's clock, seconds.
    pub delay_s: f64,
    /// True if the wheels turn 30 % too fast for 0.5 s in each 4 s and 2 % of the samples are lost.
    pub faults: bool,
}

/// The samples during a drive along a path, which starts at a time and lasts for a duration, by
/// their stamps: each is the mean over its period, stamped at its middle. `None` without wheels.
pub(crate) fn samples(
    config: &SimulatedWheelsConfig,
    seed: u64,
    path: &dyn Path,
    (start_ns, end_s): (i64, f64),
) -> Option<Vec<Sample>> {
    (config.rate_hz > 0.0).then(|| {
        let mut wheels = Wheels::new(config, seed, path);
        let count = (end_s * config.rate_hz).ceil() as usize;
        let sample = |index: usize| {
            let span_s = [index, index + 1].map(|index| index as f64 / config.rate_hz);
            let middle_s = 0.5 * (span_s[0] + span_s[1]);
            let speed_mps = wheels.measure(span_s)?;
            let stamp_ns = start_ns + ((middle_s + config.delay_s) * 1e9).round() as i64;
            Some(Sample::speed(stamp_ns, speed_mps))
        };
        (0..count).filter_map(sample).collect()
    })
}

pub(crate) fn csv(samples: &[Sample]) -> String {
    let mut text = format!("{HEADER}\n");
    for sample in samples {
        let _ = writeln!(text, "{},{}", sample.stamp_ns, sample.values[0]);
    }
    text
}

struct Wheels<'a> {
    config: &'a SimulatedWheelsConfig,
    path: &'a dyn Path,
    rng: ChaCha8Rng,
    slips: Episodes,
    /// Measured speed over the true one.
    scale: f64,
}

impl<'a> Wheels<'a> {
    fn new(config: &'a SimulatedWheelsConfig, seed: u64, path: &'a dyn Path) -> Self {
        let mut rng = Stream::WHEEL_ERRORS.generator(seed);
        let slips = Stream::WHEEL_SLIPS.generator(seed);
        let scale = 1.0 + SCALE_SIGMA * rng.sample::<f64, _>(StandardNormal);
        Self {
            config,
            path,
            rng,
            slips: Episodes::new(SLIP_EVERY_S, SLIP_S, slips),
            scale,
        }
    }

    /// The speed that is measured from one time of the drive to another, m/s; `None` if it is lost.
    fn measure(&mut self, span_s: [f64; 2]) -> Option<f64> {
        let [noise, creep] = [0, 1].map(|_| self.rng.sample::<f64, _>(StandardNormal));
        let is_lost = self.rng.random::<f64>() < LOST && self.config.faults;
        let slip_s = self.slips.begin_s(span_s[0]);
        let slip = slip_s
            .filter(|_| self.config.faults)
            .map_or(0.0, |_| SLIP_SHARE);
        let [before, after] = span_s.map(|time_s| self.path.pose(time_s));
        let duration_s = span_s[1] - span_s[0];
        let driven_mps = Twist::from_motion(&before.inv_mul(&after), duration_s).vx_mps;
        let creep_m = CREEP_M_PER_SQRT_M * (driven_mps.abs() * duration_s).sqrt() * creep;
        let rolled_mps = driven_mps + creep_m / duration_s;
        let turned = self.scale * rolled_mps * (1.0 + slip) + NOISE_MPS * noise;
        // Adding zero turns a negative one into a positive one.
        let speed_mps = (turned / STEP_MPS).round() * STEP_MPS + 0.0;
        (!is_lost).then_some(speed_mps)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{SimulationConfig, simulator::Simulator};

    fn simulated(faults: bool) -> (Simulator, Vec<Sample>) {
        let config = SimulationConfig {
            scans: Some(40),
            wheels: SimulatedWheelsConfig {
                rate_hz: 50.0,
                faults,
                ..SimulatedWheelsConfig::default()
            },
            ..SimulationConfig::default()
        };
        let simulator = Simulator::new(&config).expect("a drive");
        let (path, span) = (simulator.path(), simulator.span());
        let samples = samples(&config.wheels, config.seed, path, span).unwrap_or_default();
        (simulator, samples)
    }

    #[test]
    fn wheels_measure_the_length_of_the_path_to_the_percents_of_their_tyres() {
        let (simulator, samples) = simulated(false);
        assert_eq!(samples.len(), 500);
        let measured_m: f64 = samples.iter().map(|sample| sample.values[0] / 50.0).sum();
        let place = |ms: usize| simulator.path().pose(ms as f64 * 1e-3).translation.vector;
        let driven_m: f64 = (0..10_000)
            .map(|ms| (place(ms + 1) - place(ms)).norm())
            .sum();
        assert!(
            (measured_m / driven_m - 1.0).abs() < 0.04,
            "{measured_m} {driven_m}"
        );
    }

    #[test]
    fn wheels_with_faults_slip_for_an_eighth_of_the_time_and_lose_samples() {
        let (rolling, slipping) = (simulated(false).1, simulated(true).1);
        assert!((480..500).contains(&slipping.len()), "{}", slipping.len());
        let slips = slipping.iter().filter(|slipping| {
            let rolls = rolling.iter().find(|it| it.stamp_ns == slipping.stamp_ns);
            rolls.is_some_and(|rolling| slipping.values[0] > 1.2 * rolling.values[0])
        });
        let slips = slips.count();
        assert!((45..=80).contains(&slips), "{slips}");
    }
}
