//! The speed of the wheels: the section `[simulation.wheels]`, and what the wheels measure.

use gyre_simulator::beside::{Device, Episodes, wheels::WheelFigures};
use nalgebra::Translation2;
use serde::{Deserialize, Serialize};

use crate::{error::SimulatorError, limits::require_within, path::Path, stream::Stream};

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

/// The wheels of a drive. `None` without wheels.
pub(crate) fn device<'a>(
    config: &'a SimulatedWheelsConfig,
    seed: u64,
    path: &'a dyn Path,
) -> Option<Device<'a>> {
    let figures = WheelFigures {
        scale_sigma: config.scale_sigma,
        creep_m_per_sqrt_m: config.noise_m_per_sqrt_m,
        noise_mps: config.noise_mps,
        step_mps: config.step_mps,
        slip_share: config.slip_share,
    };
    let mut errors = Stream::WheelErrors.generator(seed);
    let axle = Translation2::new(-config.radar_ahead_m, 0.0);
    let measure = figures.measure(&mut errors, move |time_s| path.pose(time_s) * axle);
    let slips = Stream::WheelSlips.generator(seed);
    (config.rate_hz > 0.0).then(|| Device {
        rate_hz: config.rate_hz,
        stamped_at: 0.5,
        errors,
        host: None,
        clock: Box::new(|_, time_s| time_s + config.late_s),
        lost: Some(config.lost),
        episodes: Episodes::new(config.slip_every_s, config.slip_s, slips),
        stalls: false,
        measure,
    })
}

#[cfg(test)]
mod tests {
    use gyre_geometry::samples::{Sample, SampleKind};

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
        let samples = simulator.samples(SampleKind::Wheels).unwrap_or_default();
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
        assert_eq!(simulator.samples(SampleKind::Wheels), None);
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
}
