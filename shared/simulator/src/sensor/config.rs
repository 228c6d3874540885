use serde::{Deserialize, Serialize};

use crate::profile::{Profile, Receiver, Sampling};

/// Encoder counts from one azimuth to the next of a radar with another number of azimuths than its
/// profile.
const ENCODER_STEP: u16 = 14;

/// The radar: a known radar, and the values that differ from its profile.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SensorConfig {
    /// The radar. Default: `cts350x-oxford`.
    pub profile: Profile,
    /// The seed of noise, speckle and losses, for another drive through the same streets. Default:
    /// the seed of the simulation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Range bins of an azimuth. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bins: Option<usize>,
    /// Length of a bin, metres. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub bin_m: Option<f64>,
    /// Azimuths of a turn. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuths: Option<usize>,
    /// Time of one turn, seconds. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub period_s: Option<f64>,
    /// Two-way half-power width of the beam, degrees. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub beam_deg: Option<f64>,
    /// Excess of the receiver's noise over its profile, decibels.
    pub noise_db: f64,
    /// Metres to add to a bin's range. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_offset_m: Option<f64>,
    /// Doppler shift: metres of range for each m/s of closing speed; 0 for a radar without the
    /// effect. Default: the profile's.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub doppler_s: Option<f64>,
    /// Eccentricity of the encoder's disc, radians: the beam points to `azimuth + eccentricity *
    /// cos(azimuth)`, which `dataset.azimuth_eccentricity_rad` corrects.
    pub azimuth_eccentricity_rad: f64,
    /// True if the host loses azimuths, as the one of RADIATE did: the columns behind them move up,
    /// and the last ones are of the scan before. Only for `output.format = "radiate"`.
    pub lost_azimuths: bool,
}

impl SensorConfig {
    pub fn receiver(&self) -> Receiver {
        let kind = self.profile.receiver();
        Receiver {
            beam_rad: self.beam_deg.map_or(kind.beam_rad, f64::to_radians),
            // A bin is at most as long as the radar's resolution.
            cell_m: kind.cell_m.max(self.bin_m.unwrap_or(0.0)),
            ..kind
        }
    }

    pub fn sampling(&self) -> Sampling {
        let mut sampling = self.profile.sampling();
        if let Some(azimuths) = self.azimuths.filter(|count| *count != sampling.azimuths) {
            sampling.azimuths = azimuths;
            sampling.encoder_step = ENCODER_STEP;
            sampling.encoder_counts = (azimuths as u16).saturating_mul(ENCODER_STEP);
            sampling.encoder_first = 0;
        }
        Sampling {
            bins: self.bins.unwrap_or(sampling.bins),
            range_resolution_m: self.bin_m.unwrap_or(sampling.range_resolution_m),
            period_us: self.period_s.map_or(sampling.period_us, |period_s| {
                (period_s * 1e6).round() as i64
            }),
            range_offset_m: self.range_offset_m.unwrap_or(sampling.range_offset_m),
            doppler_s: self.doppler_s.unwrap_or(sampling.doppler_s),
            ..sampling
        }
    }
}
