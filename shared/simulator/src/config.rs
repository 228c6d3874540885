//! What to simulate.

use serde::{Deserialize, Serialize};

use crate::SimulatorError;

/// What to simulate. Every key has a default, and unknown keys are refused.
///
/// One configuration gives one dataset, byte for byte (for one build on one kind of machine: sines and logarithms are the system's).
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct SimulationConfig {
    /// Scans to generate. The vehicle keeps circling the block for as long as they last.
    pub scans: usize,
    /// Where all randomness comes from: the town, the speckle, the noise.
    pub seed: u64,
    /// Length of the block that the vehicle circles, from street centre to street centre, metres along x.
    pub block_length_m: f64,
    /// Width of that block, metres along y.
    pub block_width_m: f64,
    /// Speed on straights, metres a second.
    pub speed_m_s: f64,
    /// Sideways acceleration at which bends are taken, metres a second squared: it sets the speed in them.
    pub lateral_acceleration_m_s2: f64,
    /// Time of one sweep, seconds.
    pub period_s: f64,
    /// Other vehicles that drive round the same block, every second one the other way round.
    pub traffic: usize,
    /// Seconds by which a closing speed lengthens a range: a chirp cannot tell Doppler shift from delay.
    /// 0.049 has been measured on Navtech radars (Burnett et al. 2021); 0 for a radar without the effect.
    pub doppler_shift_s: f64,
}

impl Default for SimulationConfig {
    fn default() -> Self {
        Self {
            scans: 64,
            seed: 1,
            block_length_m: 40.0,
            block_width_m: 32.0,
            speed_m_s: 9.5,
            lateral_acceleration_m_s2: 5.0,
            period_s: 0.25,
            traffic: 4,
            doppler_shift_s: 0.049,
        }
    }
}

impl SimulationConfig {
    /// Refuses what cannot be simulated, naming the key.
    pub fn validate(&self) -> Result<(), SimulatorError> {
        within("scans", self.scans as f64, 1.0, 100_000.0)?;
        within("block_length_m", self.block_length_m, 30.0, 400.0)?;
        within("block_width_m", self.block_width_m, 30.0, 400.0)?;
        within("speed_m_s", self.speed_m_s, 0.5, 40.0)?;
        within("lateral_acceleration_m_s2", self.lateral_acceleration_m_s2, 0.1, 20.0)?;
        within("period_s", self.period_s, 0.05, 2.0)?;
        within("traffic", self.traffic as f64, 0.0, 20.0)?;
        within("doppler_shift_s", self.doppler_shift_s, -0.5, 0.5)
    }
}

fn within(key: &'static str, value: f64, least: f64, most: f64) -> Result<(), SimulatorError> {
    if (least..=most).contains(&value) {
        return Ok(());
    }
    Err(SimulatorError::Config { key, value: value.to_string(), expected: format!("between {least} and {most}") })
}
