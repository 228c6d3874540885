//! Rain, fog and snow: attenuation and backscatter.
//!
//! Specific attenuation follows ITU-R P.838-3 (rain: k R^alpha) and P.840 (fog, by liquid water).
//! The reflectivity of rain is Currie, Dyer and Hayes' (1975) fit A R^B at 70 GHz, and for 24 GHz
//! one between their 9.4 and 35 GHz. For snow and wet radomes, whose figures vary widely in the
//! literature, middle values are used.

use serde::{Deserialize, Serialize};

use crate::error::SimulatorError;
use crate::limits::require_within;

/// The weather from a time on: a section `[[simulation.weather]]`.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct WeatherConfig {
    /// Start, seconds after the start of the drive; the latest section that has started applies.
    pub from_s: f64,
    /// Rain, millimetres an hour: 2 light, 10 moderate, 50 heavy.
    pub rain_mm_h: f64,
    /// Fog, grams of water in a cubic metre of air: 0.05 for a visibility of 300 m, 0.5 for 50 m.
    pub fog_g_m3: f64,
    /// Snow as melted water, millimetres an hour: 1 light, 5 heavy.
    pub snow_mm_h: f64,
    /// Two-way loss of a radome that mud, ice or slush covers, decibels: from 60 on the radar is
    /// blind.
    #[serde(skip_serializing_if = "is_none")]
    pub blocked_db: f64,
}

fn is_none(loss_db: &f64) -> bool {
    *loss_db == 0.0
}

impl WeatherConfig {
    /// Checks that all values can be simulated.
    ///
    /// # Errors
    /// [`SimulatorError::Config`] with the key of the first value that cannot.
    pub fn validate(&self) -> Result<(), SimulatorError> {
        require_within("weather.from_s", self.from_s, 0.0, 1e6)?;
        require_within("weather.rain_mm_h", self.rain_mm_h, 0.0, 200.0)?;
        require_within("weather.fog_g_m3", self.fog_g_m3, 0.0, 5.0)?;
        require_within("weather.snow_mm_h", self.snow_mm_h, 0.0, 50.0)?;
        require_within("weather.blocked_db", self.blocked_db, 0.0, 200.0)
    }

    /// The weather at a time of the drive; clear before the first section.
    pub fn at(all: &[Self], time_s: f64) -> Self {
        let begun = all.iter().filter(|weather| weather.from_s <= time_s);
        begun
            .max_by(|a, b| a.from_s.total_cmp(&b.from_s))
            .copied()
            .unwrap_or_default()
    }

    /// Attenuation one way, decibels a metre, at a carrier frequency.
    pub fn attenuation_db_m(&self, carrier_ghz: f64) -> f64 {
        // P.838-3, horizontal polarisation, at 24 GHz and 77 GHz; no radar between the two is
        // simulated.
        let (k, alpha, fog_db_km, snow) = if carrier_ghz > 50.0 {
            (1.13, 0.717, 4.6, 0.6)
        } else {
            (0.142, 1.01, 0.5, 0.05)
        };
        let rain = k * self.rain_mm_h.powf(alpha);
        (rain + fog_db_km * self.fog_g_m3 + snow * self.snow_mm_h) / 1000.0
    }

    /// Two-way loss of the wet (or covered) radome, decibels.
    pub fn radome_db(&self) -> f64 {
        let rain = 2.5 * (self.rain_mm_h / 10.0).min(3.0).sqrt();
        let snow = 1.5 * (self.snow_mm_h / 3.0).min(2.0).sqrt();
        rain + snow + self.blocked_db
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
    fn the_latest_weather_applies() {
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
    fn heavy_rain_attenuates_by_ten_decibels_a_kilometre_at_77_ghz_and_clear_weather_not_at_all() {
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
