//! Rain, fog and snow: what they take from an echo, and what they send back themselves.
//!
//! Specific attenuation follows ITU-R P.838-3 (rain: k R^alpha) and P.840 (fog, by liquid water); the reflectivity of rain
//! is Currie, Dyer and Hayes' (1975) fit A R^B at 70 GHz, and for 24 GHz one between their 9.4 and 35 GHz. Snow and what a wet
//! radome takes vary widely in the literature: middle values.

use serde::{Deserialize, Serialize};

use crate::error::SimulatorError;
use crate::limits::require_within;

/// What the weather is like from some time on: a section `[[simulation.weather]]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct WeatherConfig {
    /// Seconds after the start from which it holds; the last one that has begun counts.
    pub from_s: f64,
    /// Rain, millimetres an hour: 2 light, 10 moderate, 50 heavy.
    pub rain_mm_h: f64,
    /// Fog, grams of water in a cubic metre of air: 0.05 for sight of 300 m, 0.5 for 50 m.
    pub fog_g_m3: f64,
    /// Snow as melted water, millimetres an hour: 1 light, 5 heavy.
    pub snow_mm_h: f64,
}

impl WeatherConfig {
    /// Refuses what cannot be simulated, naming the key.
    pub fn validate(&self) -> Result<(), SimulatorError> {
        require_within("weather.from_s", self.from_s, 0.0, 1e6)?;
        require_within("weather.rain_mm_h", self.rain_mm_h, 0.0, 200.0)?;
        require_within("weather.fog_g_m3", self.fog_g_m3, 0.0, 5.0)?;
        require_within("weather.snow_mm_h", self.snow_mm_h, 0.0, 50.0)
    }

    /// The weather that holds at a time of the drive: clear where none has begun.
    pub fn at(all: &[Self], time_s: f64) -> Self {
        let begun = all.iter().filter(|weather| weather.from_s <= time_s);
        begun
            .max_by(|a, b| a.from_s.total_cmp(&b.from_s))
            .copied()
            .unwrap_or_default()
    }

    /// Attenuation one way, decibels a metre, at a carrier frequency.
    pub fn attenuation_db_m(&self, carrier_ghz: f64) -> f64 {
        // P.838-3, horizontal polarisation: 24 GHz and 77 GHz; between the two nothing is simulated.
        let (k, alpha, fog_db_km, snow) = if carrier_ghz > 50.0 {
            (1.13, 0.717, 4.6, 0.6)
        } else {
            (0.142, 1.01, 0.5, 0.05)
        };
        let rain = k * self.rain_mm_h.powf(alpha);
        (rain + fog_db_km * self.fog_g_m3 + snow * self.snow_mm_h) / 1000.0
    }

    /// Loss of the wet (or snowed on) radome, there and back, decibels.
    pub fn radome_db(&self) -> f64 {
        2.5 * (self.rain_mm_h / 10.0).min(3.0).sqrt() + 1.5 * (self.snow_mm_h / 3.0).min(2.0).sqrt()
    }

    /// Backscattering cross-section of a cubic metre of air, square metres.
    pub fn reflectivity_m2_m3(&self, carrier_ghz: f64) -> f64 {
        let (a, b) = if carrier_ghz > 50.0 {
            (4.2e-5, 1.1)
        } else {
            (2.0e-7, 1.6)
        };
        let wet = |rate: f64| if rate > 0.0 { a * rate.powf(b) } else { 0.0 };
        wet(self.rain_mm_h) + 0.35 * wet(self.snow_mm_h) + 2.0e-7 * self.fog_g_m3
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_began_last_holds() {
        let rain = WeatherConfig {
            from_s: 10.0,
            rain_mm_h: 5.0,
            ..Default::default()
        };
        let fog = WeatherConfig {
            from_s: 60.0,
            fog_g_m3: 0.3,
            ..Default::default()
        };
        let all = [fog, rain];
        assert_eq!(WeatherConfig::at(&all, 5.0), WeatherConfig::default());
        assert_eq!(WeatherConfig::at(&all, 10.0), rain);
        assert_eq!(WeatherConfig::at(&all, 1e4), fog);
    }

    #[test]
    fn heavy_rain_takes_ten_decibels_a_kilometre_at_77_ghz_and_clear_air_nothing() {
        let rain = WeatherConfig {
            rain_mm_h: 25.0,
            ..Default::default()
        };
        assert!(
            (9.0..14.0).contains(&(rain.attenuation_db_m(76.5) * 1000.0)),
            "{}",
            rain.attenuation_db_m(76.5)
        );
        assert!(rain.attenuation_db_m(24.0) < 0.5 * rain.attenuation_db_m(76.5));
        let clear = WeatherConfig::default();
        assert_eq!(
            [
                clear.attenuation_db_m(76.5),
                clear.radome_db(),
                clear.reflectivity_m2_m3(76.5)
            ],
            [0.0; 3]
        );
    }
}
