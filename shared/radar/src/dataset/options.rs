//! What a configuration may say about a dataset.

use std::fmt;

use serde::{Deserialize, Serialize};

use super::error::OpenError;
use super::format::Format;

/// Where the angle of an azimuth comes from.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum AzimuthSource {
    /// The encoder's count in each row.
    Encoder,
    /// The row's number: row `i` of `n` at `2 pi i / n`.
    Uniform,
}

/// How to read a dataset. Every key may be left out; the defaults are the format's own.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct DatasetOptions {
    /// The form of files. Default: detected from the folder, else from the first image.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<Format>,
    /// Metres a range bin. Default: Oxford, OORD and FoMo 0.0438, Boreas 0.0596 (0.04381 from 2021-09-21), Boreas-RT 0.04381,
    /// MulRan 200/3360, RADIATE 100/576.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_resolution_m: Option<f32>,
    /// Metres to add to every range. Default: Boreas and Boreas-RT -0.31, all others 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_offset_m: Option<f32>,
    /// Metres to add to a range for each m/s at which the sensor approaches what it looks at, see
    /// [`SweepGeometry::doppler_s`](crate::SweepGeometry::doppler_s): 0.04 for the older Navtechs, negative where their chirps
    /// fall, 0.049 for those whose chirps alternate. Default: 0, not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub doppler_s: Option<f32>,
    /// The encoder's eccentricity, rad: the antenna looks this times the cosine of the azimuth further than the encoder says.
    /// One radar's own, found by driving a road to and fro; 2.5e-3 is a tenth of a millimetre. Default 0, not known.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_eccentricity_rad: Option<f32>,
    /// Where the azimuths come from. Default: `encoder`; `uniform` for OORD, whose encoder columns are not to be trusted, and for
    /// images without metadata (RADIATE, MulRan as recorded), which know no other.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_source: Option<AzimuthSource>,
    /// Encoder counts a turn. Default: FoMo 5595, all others 5600.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub encoder_counts: Option<u16>,
}

impl DatasetOptions {
    /// Refuses values that no radar has.
    pub(crate) fn check(&self) -> Result<(), OpenError> {
        let resolution_ok = self
            .range_resolution_m
            .is_none_or(|r| (1e-3..=10.0).contains(&r));
        let offset_ok = self
            .range_offset_m
            .is_none_or(|o| (-100.0..=100.0).contains(&o));
        let doppler_ok = self.doppler_s.is_none_or(|d| (-1.0..=1.0).contains(&d));
        let eccentricity_ok = self
            .azimuth_eccentricity_rad
            .is_none_or(|e| (-0.1..=0.1).contains(&e));
        let counts_ok = self.encoder_counts.is_none_or(|c| c >= 16);
        if !resolution_ok {
            return Err(self.refused(
                "range_resolution_m",
                self.range_resolution_m,
                "it must be from 0.001 to 10 m",
            ));
        }
        if !offset_ok {
            return Err(self.refused(
                "range_offset_m",
                self.range_offset_m,
                "it must be from -100 to 100 m",
            ));
        }
        if !doppler_ok {
            return Err(self.refused("doppler_s", self.doppler_s, "it must be from -1 to 1 s"));
        }
        if !eccentricity_ok {
            let actual = self.azimuth_eccentricity_rad;
            return Err(self.refused(
                "azimuth_eccentricity_rad",
                actual,
                "it must be from -0.1 to 0.1 rad",
            ));
        }
        if !counts_ok {
            return Err(self.refused(
                "encoder_counts",
                self.encoder_counts,
                "an encoder has at least 16 counts a turn",
            ));
        }
        Ok(())
    }

    /// These options, and `other`'s where these say nothing.
    #[must_use]
    pub fn or(self, other: &Self) -> Self {
        Self {
            format: self.format.or(other.format),
            range_resolution_m: self.range_resolution_m.or(other.range_resolution_m),
            range_offset_m: self.range_offset_m.or(other.range_offset_m),
            doppler_s: self.doppler_s.or(other.doppler_s),
            azimuth_eccentricity_rad: self
                .azimuth_eccentricity_rad
                .or(other.azimuth_eccentricity_rad),
            azimuth_source: self.azimuth_source.or(other.azimuth_source),
            encoder_counts: self.encoder_counts.or(other.encoder_counts),
        }
    }

    /// Refuses what needs an encoder, for images that have none.
    pub(crate) fn check_without_encoder(&self, format: Format) -> Result<(), OpenError> {
        let options = Self {
            format: Some(format),
            ..*self
        };
        if self.encoder_counts.is_some() {
            return Err(options.refused(
                "encoder_counts",
                self.encoder_counts,
                "its images carry no encoder counts",
            ));
        }
        if self.azimuth_source == Some(AzimuthSource::Encoder) {
            return Err(options.refused(
                "azimuth_source",
                Some("encoder"),
                "its images carry no encoder counts",
            ));
        }
        Ok(())
    }

    fn refused(
        &self,
        key: &'static str,
        value: Option<impl fmt::Display>,
        reason: &'static str,
    ) -> OpenError {
        OpenError::BadOption {
            key,
            value: value.map(|v| v.to_string()).unwrap_or_default(),
            format: self.format.map_or("any".to_owned(), |f| f.to_string()),
            reason,
        }
    }
}
