//! Configuration of the searches. Every key has a default; an error names the key of an invalid
//! value.

use std::ops::RangeInclusive;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{section}.{key} = {actual}: expected {expected}")]
pub struct ConfigError {
    pub section: &'static str,
    pub key: &'static str,
    pub actual: String,
    pub expected: &'static str,
}

/// The comparison of two polar spectra.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
pub enum RotationForm {
    /// Circular correlation along the angle, summed over radii (Weston et al., Eq. 7).
    #[default]
    #[serde(rename = "eq7")]
    Eq7,
    /// Mean over all radial shifts (Weston et al., Algorithm 1, line 14), which is the correlation
    /// of the two profiles summed over the radius.
    #[serde(rename = "line14")]
    ProfileMean,
}

/// The scale of spectral magnitudes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Magnitude {
    /// The magnitude itself.
    #[default]
    Linear,
    /// ln(1 + magnitude / mean magnitude of the band). Weak structure counts beside strong
    /// structure, and so does noise. Helps where the band includes the lowest frequencies, which
    /// dominate the others.
    Log,
}

/// The weight of the raster before the Fourier transform of the rotation search.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Taper {
    /// No weight, for rasters that already end in zeros.
    None,
    /// Product of two Hann windows (Weston et al., Algorithm 1, line 5).
    Hann,
    /// Hann window of the range: equal in all directions, so that it adds no direction of its own
    /// to the spectrum.
    #[default]
    RadialHann,
}

/// The interpolation of a peak between samples.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case", deny_unknown_fields)]
pub enum Peak {
    /// A Gaussian over a pedestal, the lowest of the neighbouring samples: errors up to 0.02 of a
    /// step.
    #[default]
    Gaussian,
    /// A parabola through three samples along each axis: errors up to 0.1 of a step on narrow
    /// peaks.
    Parabola,
    /// Mean of all positions within reach, weighted with exp(temperature z), where z is the score
    /// less the highest score, over the scores' standard deviation (Weston et al., Algorithm 1,
    /// lines 15 and 19).
    SoftArgmax {
        /// Inverse width of the weight; 2 for the angle and 1 for the shift in the paper.
        temperature: f64,
    },
}

/// The normalisation for an overlap that shrinks as the shift grows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Overlap {
    /// None: the plain correlation, biased towards zero shift.
    None,
    /// Divides by the share of the cells that overlap.
    Area,
    /// Divides by the energy of each raster within the overlap, so that each value is a correlation
    /// coefficient of what both scans see.
    #[default]
    Energy,
}

/// Configuration of [`RotationSearch`](crate::RotationSearch): section `[rotation]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct RotationConfig {
    /// Comparison of the polar spectra: `eq7` (Weston et al., Eq. 7) or `line14` (their Algorithm
    /// 1, line 14).
    pub form: RotationForm,
    /// Scale of the spectral magnitudes: the descriptors of places take logarithms.
    #[serde(skip)]
    pub magnitude: Magnitude,
    /// Phase correlation: keeps only the phase of the transform of the polar spectra (Checchin et
    /// al., Eq. 6).
    pub phase_only: bool,
    /// Window over the raster: `none`, `hann` or `radial_hann`.
    pub window: Taper,
    /// Lower end of the frequency band, cycles per cell. Structure longer than 20 cells contributes
    /// little to the angle and is dominated by the decrease of power with range, which does not
    /// rotate with the scene.
    pub band_low: f64,
    /// Upper end of the frequency band, cycles per cell; below 0.5.
    pub band_high: f64,
    /// Number of samples of the angle over half a turn. Products of small primes are fast; 733 (the
    /// paper) takes six times as long.
    pub angles: usize,
    /// Number of samples of the radius over the band. Default: about one per frequency bin.
    pub radii: Option<usize>,
    /// Largest angle searched to either side, degrees; at most 90.
    pub reach_deg: f64,
    /// Interpolation of the peak between samples.
    pub peak: Peak,
}

impl Default for RotationConfig {
    fn default() -> Self {
        Self {
            form: RotationForm::default(),
            magnitude: Magnitude::default(),
            phase_only: false,
            window: Taper::default(),
            band_low: 0.05,
            band_high: 0.45,
            angles: 576,
            radii: None,
            reach_deg: 20.0,
            peak: Peak::default(),
        }
    }
}

/// Configuration of [`TranslationSearch`](crate::TranslationSearch): section `[translation]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct TranslationConfig {
    /// Largest shift searched along each axis, m.
    pub reach_m: f64,
    /// Phase correlation: keeps only the phase of the cross-spectrum (Checchin et al., Eq. 6).
    pub phase_only: bool,
    /// Normalisation for the shrinking overlap: `none`, `area` or `energy`. No effect with
    /// `phase_only`.
    pub overlap: Overlap,
    /// Interpolation of the peak between cells.
    pub peak: Peak,
}

impl Default for TranslationConfig {
    fn default() -> Self {
        Self {
            reach_m: 12.0,
            phase_only: false,
            overlap: Overlap::default(),
            peak: Peak::default(),
        }
    }
}

impl RotationConfig {
    pub fn validate(&self) -> Result<(), ConfigError> {
        let section = Section("rotation");
        section.require(
            self.band_low >= 0.0 && self.band_low < self.band_high,
            "band_low",
            &self.band_low,
            "at least 0 and below band_high",
        )?;
        let fits = self.band_high < 0.5;
        let bounds = "cycles per cell, below 0.5";
        section.require(fits, "band_high", &self.band_high, bounds)?;
        section.within("angles", self.angles, 16..=1 << 14, "16 to 16384")?;
        let radii = self.radii.unwrap_or(2);
        section.within("radii", radii, 2..=1 << 13, "2 to 8192")?;
        let fits = self.reach_deg > 0.0 && self.reach_deg <= 90.0;
        section.require(fits, "reach_deg", &self.reach_deg, "above 0, at most 90")?;
        section.positive("peak.soft_argmax.temperature", self.peak.temperature())
    }
}

impl TranslationConfig {
    pub fn validate(&self) -> Result<(), ConfigError> {
        let section = Section("translation");
        let fits = positive(self.reach_m);
        section.require(fits, "reach_m", &self.reach_m, "metres, above 0")?;
        section.positive("peak.soft_argmax.temperature", self.peak.temperature())
    }
}

impl Peak {
    fn temperature(&self) -> f64 {
        match *self {
            Peak::SoftArgmax { temperature } => temperature,
            _ => 1.0,
        }
    }
}

pub(crate) fn positive(value: f64) -> bool {
    value.is_finite() && value > 0.0
}

#[derive(Clone, Copy)]
pub(crate) struct Section(pub &'static str);

impl Section {
    pub fn require(
        self,
        fits: bool,
        key: &'static str,
        actual: &dyn ToString,
        expected: &'static str,
    ) -> Result<(), ConfigError> {
        match fits {
            true => Ok(()),
            false => Err(ConfigError {
                section: self.0,
                key,
                actual: actual.to_string(),
                expected,
            }),
        }
    }

    pub fn within<T: PartialOrd + ToString>(
        self,
        key: &'static str,
        value: T,
        bounds: RangeInclusive<T>,
        expected: &'static str,
    ) -> Result<(), ConfigError> {
        self.require(bounds.contains(&value), key, &value, expected)
    }

    pub fn positive(self, key: &'static str, value: f64) -> Result<(), ConfigError> {
        self.require(positive(value), key, &value, "a positive number")
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn missing_keys_have_their_defaults() {
        let text =
            "form = \"line14\"\nangles = 733\npeak = { soft_argmax = { temperature = 2.0 } }";
        let config: RotationConfig = toml::from_str(text).unwrap();
        let peak = Peak::SoftArgmax { temperature: 2.0 };
        let want = RotationConfig {
            form: RotationForm::ProfileMean,
            angles: 733,
            peak,
            ..RotationConfig::default()
        };
        assert_eq!(config, want);
        let written = toml::to_string(&want).unwrap();
        assert_eq!(toml::from_str::<RotationConfig>(&written).unwrap(), want);
    }

    #[test]
    fn unknown_keys_are_rejected() {
        let wrong = toml::from_str::<RotationConfig>("angels = 720").unwrap_err();
        assert!(wrong.to_string().contains("angels"));
        let wrong = toml::from_str::<TranslationConfig>("reach = 3.0").unwrap_err();
        assert!(wrong.to_string().contains("reach"));
        let text = "peak = { soft_argmax = { t = 1.0 } }";
        assert!(toml::from_str::<TranslationConfig>(text).is_err());
    }
}
