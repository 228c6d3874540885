//! Messages of the radar's description of itself, and of one azimuth.

use std::ops::RangeInclusive;

use gyre_colossus::{Azimuth, Configuration, Powers};

use crate::{
    Ros2Message,
    definition::bad,
    messages::{RadarConfigurationMessage, RadarFftDataMessage},
    navtech_msgs::{RadarConfigurationMsg, RadarFftDataMsg},
    std_msgs::Header,
};

/// Bins per metre of `bin_size`.
const BIN_SIZES: f64 = 1e4;
/// Depths of a bin that a radar can have, m. Their ratio is less than [`BIN_SIZES`], so that no
/// number is one of them in both units.
const DEPTHS_M: RangeInclusive<f64> = 1e-3..=5.0;
/// The largest rate that is in turns per second: no radar turns as slowly as this in turns per 1000
/// s, or as quickly.
const MAX_TURNS_PER_S: u16 = 50;

/// The description that a radar gives of itself, and by how many rows its driver turns images.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DescribedRadar {
    pub radar: Configuration,
    pub azimuth_offset: u16,
}

impl RadarConfigurationMsg {
    pub fn configuration(&self) -> Result<DescribedRadar, String> {
        let radar = Configuration {
            azimuth_samples: self.azimuth_samples,
            range_in_bins: self.range_in_bins,
            encoder_size: self.encoder_size,
            rotation_mhz: rotation_mhz(self.expected_rotation_rate),
            range_gain: self.range_gain,
            range_offset: self.range_offset,
            ..of_depth(resolution_m::<Self>(self.bin_size.into())?)
        };
        Ok(DescribedRadar {
            radar,
            azimuth_offset: self.azimuth_offset,
        })
    }

    /// Returns the message of a configuration. The depth of a bin is exact if a number of 32 bits
    /// divided by 10,000 can be.
    pub fn of(configuration: &Configuration, header: Header) -> Self {
        Self {
            header,
            azimuth_samples: configuration.azimuth_samples,
            encoder_size: configuration.encoder_size,
            azimuth_offset: 0,
            bin_size: bin_size(configuration.range_resolution_m()),
            range_in_bins: configuration.range_in_bins,
            expected_rotation_rate: configuration.rotation_mhz,
            range_gain: configuration.range_gain,
            range_offset: configuration.range_offset,
        }
    }
}

impl RadarConfigurationMessage {
    pub fn configuration(&self) -> Result<DescribedRadar, String> {
        let short = |field, bytes: &[u8]| number::<Self, 2>(field, bytes).map(u16::from_be_bytes);
        // Unlike the others: the driver copies the double as its computer has it.
        let bin_size = f64::from_le_bytes(number::<Self, 8>("bin_size", &self.bin_size)?);
        let rate = short("expected_rotation_rate", &self.expected_rotation_rate)?;
        let radar = Configuration {
            azimuth_samples: short("azimuth_samples", &self.azimuth_samples)?,
            range_in_bins: short("range_in_bins", &self.range_in_bins)?,
            encoder_size: short("encoder_size", &self.encoder_size)?,
            rotation_mhz: rotation_mhz(rate),
            ..of_depth(resolution_m::<Self>(bin_size)?)
        };
        Ok(DescribedRadar {
            radar,
            azimuth_offset: 0,
        })
    }
}

impl RadarFftDataMsg {
    /// Returns the azimuth as the radar sent it. The angle comes from the encoder, because
    /// [`RadarFftDataMsg::angle`] is wrong.
    pub fn azimuth(&self) -> Azimuth<'_> {
        Azimuth {
            sweep_counter: self.sweep_counter,
            encoder: self.azimuth,
            seconds: self.ntp_seconds.to_le_bytes(),
            split_seconds: self.ntp_split_seconds.to_le_bytes(),
            powers: Powers::Eight(&self.data),
        }
    }
}

impl RadarFftDataMessage {
    pub fn azimuth(&self) -> Result<Azimuth<'_>, String> {
        let sweep_counter = number::<Self, 2>("sweep_counter", &self.sweep_counter)?;
        Ok(Azimuth {
            sweep_counter: u16::from_be_bytes(sweep_counter),
            encoder: u16::from_be_bytes(number::<Self, 2>("azimuth", &self.azimuth)?),
            seconds: number::<Self, 4>("ntp_seconds", &self.ntp_seconds)?,
            split_seconds: number::<Self, 4>("ntp_split_seconds", &self.ntp_split_seconds)?,
            powers: Powers::Eight(&self.data),
        })
    }
}

/// Returns the bytes of a number that is an array of its bytes.
fn number<T: Ros2Message, const N: usize>(field: &str, bytes: &[u8]) -> Result<[u8; N], String> {
    let reason = || format!("`{field}` has {} bytes, expected {N}", bytes.len());
    bytes.try_into().map_err(|_| bad::<T>(reason()))
}

/// Returns the depth of a bin, m, of a `bin_size` in 1e-4 m, or of the oldest drivers in m.
fn resolution_m<T: Ros2Message>(bin_size: f64) -> Result<f32, String> {
    let candidates = [bin_size / BIN_SIZES, bin_size];
    let depth_m = candidates.into_iter().find(|m| DEPTHS_M.contains(m));
    depth_m.map(|m| m as f32).ok_or_else(|| {
        let (least, most) = (DEPTHS_M.start(), DEPTHS_M.end());
        bad::<T>(format_args!(
            "`bin_size` is {bin_size:e}, and no radar has bins of that many 0.1 mm or m: {least} to {most} m are known"
        ))
    })
}

fn of_depth(resolution_m: f32) -> Configuration {
    Configuration {
        bin_size: (f64::from(resolution_m) * BIN_SIZES).round() as u16,
        range_resolution_m: Some(resolution_m),
        ..Configuration::default()
    }
}

fn rotation_mhz(rate: u16) -> u16 {
    match rate <= MAX_TURNS_PER_S {
        true => rate * 1000,
        false => rate,
    }
}

/// Returns the number that comes back as this depth of a bin, or else the nearest.
fn bin_size(resolution_m: f32) -> f32 {
    let nearest = (f64::from(resolution_m) * BIN_SIZES) as f32;
    let candidates = [nearest, nearest.next_down(), nearest.next_up()];
    let comes_back = |size: &f32| (f64::from(*size) / BIN_SIZES) as f32 == resolution_m;
    candidates.into_iter().find(comes_back).unwrap_or(nearest)
}
