//! Attenuation and backscatter by the weather.

use crate::profile::Receiver;
use crate::weather::WeatherConfig;

/// The atmosphere between sensor and echoes.
#[derive(Clone, Copy, Debug)]
pub(super) struct Atmosphere {
    /// Two-way share of the power that passes a wet radome.
    radome: f64,
    /// Two-way attenuation, nepers of power a metre.
    nepers_m: f64,
    /// Backscattering cross-section of a cubic metre, square metres.
    reflectivity_m2_m3: f64,
}

/// Half-power height of the beam, radians: Navtech state 1.8 degrees for the antenna's upper part,
/// widened downwards.
const BEAM_HEIGHT_RAD: f64 = 0.07;

impl Atmosphere {
    pub fn new(weather: &WeatherConfig, carrier_ghz: f64) -> Self {
        Self {
            radome: 10f64.powf(-weather.radome_db() / 10.0),
            nepers_m: 2.0 * weather.attenuation_db_m(carrier_ghz) * std::f64::consts::LN_10 / 10.0,
            reflectivity_m2_m3: weather.reflectivity_m2_m3(carrier_ghz),
        }
    }

    /// Two-way share of the power that passes to a range.
    pub fn transmission(&self, range_m: f64) -> f64 {
        self.radome * (-self.nepers_m * range_m).exp()
    }

    /// Backscattering cross-section of one resolution cell, square metres.
    pub fn clutter_m2(&self, range_m: f64, receiver: &Receiver) -> f64 {
        // One-way beams are wider than two-way ones by the square root of two.
        let area_m2 =
            range_m * range_m * std::f64::consts::SQRT_2 * receiver.beam_rad * BEAM_HEIGHT_RAD;
        self.reflectivity_m2_m3 * area_m2 * receiver.cell_m
    }
}
