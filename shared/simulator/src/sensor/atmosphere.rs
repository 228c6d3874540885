//! What the weather does to a radar's echoes.

use crate::profile::Receiver;
use crate::weather::WeatherConfig;

/// The air between sensor and echo.
#[derive(Clone, Copy, Debug)]
pub(super) struct Atmosphere {
    /// Share of the power that a wet radome lets through, there and back.
    radome: f64,
    /// Attenuation there and back, nepers of power a metre.
    nepers_m: f64,
    /// Cross-section of a cubic metre, square metres.
    reflectivity_m2_m3: f64,
}

/// Height of the beam at half power, radians: Navtech state 1.8 degrees for the antenna's upper part, spread downwards to fill in.
const BEAM_HEIGHT_RAD: f64 = 0.07;

impl Atmosphere {
    pub fn new(weather: &WeatherConfig, carrier_ghz: f64) -> Self {
        Self {
            radome: 10f64.powf(-weather.radome_db() / 10.0),
            nepers_m: 2.0 * weather.attenuation_db_m(carrier_ghz) * std::f64::consts::LN_10 / 10.0,
            reflectivity_m2_m3: weather.reflectivity_m2_m3(carrier_ghz),
        }
    }

    /// Share of the power that passes to a range and back.
    pub fn passed(&self, range_m: f64) -> f64 {
        self.radome * (-self.nepers_m * range_m).exp()
    }

    /// Cross-section of the drops in one resolution cell, square metres.
    pub fn clutter_m2(&self, range_m: f64, receiver: &Receiver) -> f64 {
        // One-way beams are wider than two-way ones by the root of two.
        let area_m2 =
            range_m * range_m * std::f64::consts::SQRT_2 * receiver.beam_rad * BEAM_HEIGHT_RAD;
        self.reflectivity_m2_m3 * area_m2 * receiver.cell_m
    }
}
