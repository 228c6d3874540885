//! The speed of the wheels: the section `[simulation.wheels]`, and the log that it leaves.

use std::fmt::Write as _;

use gyre_geometry::{Pose, Twist, samples::Sample};
use nalgebra::Translation2;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

use crate::{episodes::Episodes, error::SimulatorError, limits::require_within, path::Path, stream::Stream};

/// The file beside the scans.
pub(crate) const FILE: &str = "wheels.csv";
/// The first row of the file.
const HEADER: &str = "stamp_ns,speed_m_s";

/// The speed by the wheels of the axle that does not steer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SimulatedWheelsConfig {
    /// Samples a second. Default: 0, no wheels, and then the other keys have no effect.
    pub rate_hz: f64,
    /// The seed of their errors. Default: the seed of the simulation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Standard deviation of the scale, a share: what a drive has is drawn from the seed.
    pub scale_sigma: f64,
    /// Noise of the distance, m/√m: tyres creep, and the road is not even.
    pub noise_m_per_sqrt_m: f64,
    /// Standard deviation of each sample, m/s.
    pub noise_mps: f64,
    /// Step to which speeds are rounded, m/s; 0 for none.
    pub step_mps: f64,
    /// Time between slips, s, one in each such time; 0 for none.
    pub slip_every_s: f64,
    /// Duration of a slip, s.
    pub slip_s: f64,
    /// Share by which the wheels turn too fast while they slip; negative: they are braked.
    pub slip_share: f64,
    /// Time by which stamps are late against the radar's, s.
    pub late_s: f64,
    /// Share of the samples that are lost.
    pub lost: f64,
    /// Distance by which the radar is ahead of the axle, m.
    pub radar_ahead_m: f64,
}

impl Default for SimulatedWheelsConfig {
    /// A car's bus: tyres that are a percent off, speeds in hundredths of a km/h.
    fn default() -> Self {
        Self {
            rate_hz: 0.0,
            seed: None,
            scale_sigma: 0.01,
            noise_m_per_sqrt_m: 0.01,
            noise_mps: 0.02,
            step_mps: 0.01 / 3.6,
            slip_every_s: 0.0,
            slip_s: 0.0,
            slip_share: 0.3,
            late_s: 0.0,
            lost: 0.0,
            radar_ahead_m: 0.0,
        }
    }
}

impl SimulatedWheelsConfig {
    /// Returns whether all keys are as configurations leave them out.
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Checks that all values can be simulated.
    ///
    /// # Errors
    /// [`SimulatorError::Config`] with the key of the first value that cannot.
    pub fn validate(&self) -> Result<(), SimulatorError> {
        require_within("wheels.rate_hz", self.rate_hz, 0.0, 1000.0)?;
        require_within("wheels.scale_sigma", self.scale_sigma, 0.0, 0.1)?;
        require_within(
            "wheels.noise_m_per_sqrt_m",
            self.noise_m_per_sqrt_m,
            0.0,
            1.0,
        )?;
        require_within("wheels.noise_mps", self.noise_mps, 0.0, 1.0)?;
        require_within("wheels.step_mps", self.step_mps, 0.0, 10.0)?;
        require_within("wheels.slip_every_s", self.slip_every_s, 0.0, 1e6)?;
        require_within("wheels.slip_s", self.slip_s, 0.0, self.slip_every_s)?;
        require_within("wheels.slip_share", self.slip_share, -1.0, 10.0)?;
        require_within("wheels.late_s", self.late_s, -1e6, 1e6)?;
        require_within("wheels.lost", self.lost, 0.0, 1.0)?;
        require_within("wheels.radar_ahead_m", self.radar_ahead_m, -10.0, 10.0)
    }
}

/// The samples during a drive, whose start is `start_ns` and which ends `end_s` later, by their
/// stamps: each is the mean over its period, stamped at its middle. `None` without wheels.
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
            let stamp_ns = start_ns + ((middle_s + config.late_s) * 1e9).round() as i64;
            Some(Sample::speed(stamp_ns, speed_mps))
        };
        (0..count).filter_map(sample).collect()
    })
}

/// The samples as CSV: the numbers read from it are those of the samples.
pub(crate) fn csv(samples: &[Sample]) -> Vec<u8> {
    let mut text = format!("{HEADER}\n");
    for sample in samples {
        let _ = writeln!(text, "{},{}", sample.stamp_ns, sample.values[0]);
    }
    text.into_bytes()
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
        let mut rng = Stream::WheelErrors.generator(seed);
        let slips = Stream::WheelSlips.generator(seed);
        let scale = 1.0 + config.scale_sigma * rng.sample::<f64, _>(StandardNormal);
        Self {
            config,
            path,
            rng,
            slips: Episodes::new(config.slip_every_s, config.slip_s, slips),
            scale,
        }
    }

    /// The speed that is measured from one time of the drive to another, m/s; `None` if it is lost.
    fn measure(&mut self, span_s: [f64; 2]) -> Option<f64> {
        let config = self.config;
        let [noise, creep] = [0, 1].map(|_| self.rng.sample::<f64, _>(StandardNormal));
        let is_lost = self.rng.random::<f64>() < config.lost;
        let [before, after] = span_s.map(|time_s| self.axle(time_s));
        let duration_s = span_s[1] - span_s[0];
        let driven_mps = Twist::from_motion(&before.inv_mul(&after), duration_s).vx_mps;
        let creep_m = config.noise_m_per_sqrt_m * (driven_mps.abs() * duration_s).sqrt() * creep;
        let rolled_mps = driven_mps + creep_m / duration_s;
        let turned =
            self.scale * rolled_mps * (1.0 + self.slip(span_s[0])) + config.noise_mps * noise;
        let speed_mps = match config.step_mps > 0.0 {
            // Adding zero turns a negative one into a positive one.
            true => (turned / config.step_mps).round() * config.step_mps + 0.0,
            false => turned,
        };
        (!is_lost).then_some(speed_mps)
    }

    fn axle(&self, time_s: f64) -> Pose {
        self.path.pose(time_s) * Translation2::new(-self.config.radar_ahead_m, 0.0)
    }

    /// The share by which the wheels turn too fast.
    fn slip(&mut self, time_s: f64) -> f64 {
        let slip_s = self.slips.begin_s(time_s);
        slip_s.map_or(0.0, |_| self.config.slip_share)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{SimulationConfig, Simulator};

    fn simulated(wheels: SimulatedWheelsConfig) -> (Simulator, Vec<Sample>) {
        let mut config = SimulationConfig {
            scans: Some(40),
            wheels,
            ..SimulationConfig::default()
        };
        config.drive.speed_mps = 8.0;
        let simulator = Simulator::new(&config).expect("a drive");
        let samples = simulator.wheel_samples().unwrap_or_default();
        (simulator, samples)
    }

    fn exact() -> SimulatedWheelsConfig {
        SimulatedWheelsConfig {
            rate_hz: 50.0,
            scale_sigma: 0.0,
            noise_m_per_sqrt_m: 0.0,
            noise_mps: 0.0,
            step_mps: 0.0,
            ..SimulatedWheelsConfig::default()
        }
    }

    #[test]
    fn without_a_rate_there_are_no_wheels() {
        let (simulator, _) = simulated(SimulatedWheelsConfig::default());
        assert_eq!(simulator.wheel_samples(), None);
    }

    #[test]
    fn exact_wheels_measure_the_length_of_the_path() {
        let (simulator, samples) = simulated(exact());
        let measured_m: f64 = samples.iter().map(|sample| sample.values[0] / 50.0).sum();
        let end_s = samples.len() as f64 / 50.0;
        let steps = (0..(end_s * 1000.0) as usize).map(|ms| ms as f64 * 1e-3);
        let path = simulator.path();
        let driven_m: f64 = steps
            .map(|at_s| {
                let [from, to] = [at_s, at_s + 1e-3].map(|at_s| path.pose(at_s).translation.vector);
                (to - from).norm()
            })
            .sum();
        assert!(
            (measured_m - driven_m).abs() < 1e-3 * driven_m,
            "{measured_m} {driven_m}"
        );
    }

    #[test]
    fn wheels_that_slip_turn_too_fast_for_so_long_in_each_time() {
        let (_, rolling) = simulated(exact());
        let (_, slipping) = simulated(SimulatedWheelsConfig {
            slip_every_s: 2.0,
            slip_s: 0.5,
            slip_share: 0.25,
            ..exact()
        });
        let ratios = rolling
            .iter()
            .zip(&slipping)
            .map(|(a, b)| b.values[0] / a.values[0]);
        let ratios: Vec<f64> = ratios.collect();
        let slips = ratios
            .iter()
            .filter(|ratio| (*ratio - 1.25).abs() < 1e-9)
            .count();
        let rolls = ratios
            .iter()
            .filter(|ratio| (*ratio - 1.0).abs() < 1e-9)
            .count();
        assert_eq!(slips + rolls, ratios.len());
        // A quarter of ten seconds.
        assert!((115..=135).contains(&slips), "{slips}");
    }

    #[test]
    fn a_log_has_the_numbers_of_its_samples() {
        let (_, samples) = simulated(SimulatedWheelsConfig {
            lost: 0.1,
            ..SimulatedWheelsConfig {
                rate_hz: 50.0,
                ..SimulatedWheelsConfig::default()
            }
        });
        assert!((400..500).contains(&samples.len()));
        let text = String::from_utf8(csv(&samples)).expect("text");
        let rows = text.lines().skip(1).zip(&samples);
        for (row, sample) in rows {
            let (stamp, speed) = row.split_once(',').expect("two columns");
            assert_eq!(stamp.parse(), Ok(sample.stamp_ns));
            assert_eq!(speed.parse(), Ok(sample.values[0]));
        }
    }
}
