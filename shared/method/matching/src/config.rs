//! Configuration of the searches. Every key has a default; an error names the key of an invalid
//! value.

use gyre_geometry::{Bounds, SettingError, check, check_bounds};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

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
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Peak {
    /// A Gaussian over a pedestal, the lowest of the neighbouring samples: errors up to 0.02 of a
    /// step.
    #[default]
    Gaussian,
    /// A parabola through three samples along each axis: errors up to 0.1 of a step on narrow
    /// peaks.
    Parabola,
}

/// The normalisation for an overlap that shrinks as the shift grows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Overlap {
    /// None: the plain correlation, biased towards zero shift.
    None,
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
    /// Normalisation for the shrinking overlap: `none` or `energy`. No effect with `phase_only`.
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
    pub fn validate(&self) -> Result<(), SettingError> {
        let below_band_high = [0.0, self.band_high.next_down()];
        check_bounds! { self, "rotation":
            band_low in (below_band_high, "at least 0 and below band_high"),
            band_high in ([0.0, 0.5_f64.next_down()], "cycles per cell, below 0.5"),
        }
        let angles = ([16.0, 16384.0], "16 to 16384");
        check("rotation", "angles", self.angles as f64, angles)?;
        let radii = self.radii.unwrap_or(2) as f64;
        check("rotation", "radii", radii, ([2.0, 8192.0], "2 to 8192"))?;
        let reach = ([f64::MIN_POSITIVE, 90.0], "above 0, at most 90");
        check("rotation", "reach_deg", self.reach_deg, reach)
    }
}

impl TranslationConfig {
    pub fn validate(&self) -> Result<(), SettingError> {
        check("translation", "reach_m", self.reach_m, METRES)
    }
}

const ABOVE_0: [f64; 2] = [f64::MIN_POSITIVE, f64::MAX];
pub(crate) const METRES: Bounds = (ABOVE_0, "metres, above 0");
pub(crate) const POSITIVE: Bounds = (ABOVE_0, "a positive number");
