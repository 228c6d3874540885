//! Options for reading a dataset.

use std::fmt;
use std::io::ErrorKind;
use std::path::Path;

use arrayvec::ArrayString;
use serde::{Deserialize, Serialize};

use super::error::OpenError;
use super::format::Format;
use crate::in_plain_words;

/// The source of the azimuth angles.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum AzimuthSource {
    /// The encoder count of each row.
    Encoder,
    /// Uniform spacing: row `i` of `n` at `2 pi i / n`.
    Uniform,
}

impl fmt::Display for AzimuthSource {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Encoder => "encoder",
            Self::Uniform => "uniform",
        })
    }
}

/// The way to treat azimuths that the host of a radar has lost.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum LostAzimuthOption {
    /// Count them in each scan, and find where they were lost.
    Find,
    /// Take each row for the azimuth that it would be if none was lost.
    Ignore,
}

/// The file of options that are stored with a recording, beside the folder of images or in it.
const FILE: &str = "dataset.toml";
/// The longest name of a topic, bytes.
const TOPIC_BYTES: usize = 256;

/// The way to read a dataset: the section `[dataset]` of a configuration. All keys are optional;
/// the defaults depend on the format.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(deny_unknown_fields, default)]
pub struct DatasetOptions {
    /// The file format. Default: detected from the folder, else from the first image.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub format: Option<Format>,
    /// Depth of a range bin, m. Default: Oxford, OORD and FoMo 0.0438, Boreas 0.0596 (0.04381 from
    /// 2021-09-21), Boreas-RT 0.04381, MulRan 200/3360, RADIATE 100/576.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_resolution_m: Option<f32>,
    /// Offset of the ranges, m. Default: Boreas and Boreas-RT -0.31, FoMo -0.32, all others 0.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub range_offset_m: Option<f32>,
    /// Doppler coefficient, s: metres to add to a range for each m/s of closing speed, see
    /// `SweepGeometry::doppler_s`. About 0.04 for older Navtech radars (negative for falling
    /// chirps), 0.049 for those with alternating chirps. Default: 0, unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub doppler_s: Option<f32>,
    /// Eccentricity of the encoder, rad: the true azimuth is the encoder's plus this times its
    /// cosine. It is specific to one radar, and found by driving a road in both directions; 2.5e-3
    /// corresponds to 0.1 mm. Default: 0, unknown.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_eccentricity_rad: Option<f32>,
    /// Source of the azimuth angles. Default: `encoder`; `uniform` for OORD, whose encoder columns
    /// are unreliable, and for images without metadata (RADIATE, MulRan as recorded), which have no
    /// encoder.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub azimuth_source: Option<AzimuthSource>,
    /// Encoder counts per turn. Default: the number that the first scans show; else the number in
    /// a bag, or 5600.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub encoder_counts: Option<u16>,
    /// Azimuths that the host has lost, in images without metadata (RADIATE, MulRan as recorded):
    /// the columns behind them have moved up, and the last columns are of the scan before. Default:
    /// `find`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lost_azimuths: Option<LostAzimuthOption>,
    /// The topic of the scans in a bag of ROS 2. Default: the one whose type is of Navtech's
    /// driver.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schemars(with = "Option<String>")]
    pub topic: Option<ArrayString<TOPIC_BYTES>>,
}

impl DatasetOptions {
    /// Rejects values out of bounds.
    pub fn check(&self) -> Result<(), OpenError> {
        let counts = self.encoder_counts.map(f32::from);
        let bins = "radars of 0.1 to 7.5 GHz bandwidth have bins of 1.5 to 0.02 m";
        let eccentricity = self.azimuth_eccentricity_rad;
        let by_delays = "the delays inside radars make -5 to 5 m";
        let a_second = "it must be from -1 to 1 s";
        let a_tenth = "it must be from -0.1 to 0.1 rad";
        let sixteen = "an encoder has at least 16 counts per turn";
        for (key, value, bounds, reason) in [
            (
                "range_resolution_m",
                self.range_resolution_m,
                0.02..=1.5,
                bins,
            ),
            ("range_offset_m", self.range_offset_m, -5.0..=5.0, by_delays),
            ("doppler_s", self.doppler_s, -1.0..=1.0, a_second),
            (
                "azimuth_eccentricity_rad",
                eccentricity,
                -0.1..=0.1,
                a_tenth,
            ),
            ("encoder_counts", counts, 16.0..=f32::INFINITY, sixteen),
        ] {
            if let Some(value) = value.filter(|value| !bounds.contains(value)) {
                return Err(OpenError::option(None, key, value, reason));
            }
        }
        Ok(())
    }

    /// Returns these options; `other` supplies the ones that are not set.
    #[must_use]
    pub fn or(self, other: &Self) -> Self {
        macro_rules! or {
            ($($option:ident)*) => { Self { $($option: self.$option.or(other.$option)),* } };
        }
        or!(format range_resolution_m range_offset_m doppler_s azimuth_eccentricity_rad
            azimuth_source encoder_counts lost_azimuths topic)
    }

    /// Rejects the option of bags, for images.
    pub(crate) fn check_without_topics(&self, format: Format) -> Result<(), OpenError> {
        let reason = "images have no topics; leave the key out";
        self.topic.map_or(Ok(()), |topic| {
            Err(OpenError::option(Some(format), "topic", topic, reason))
        })
    }

    /// Rejects options that require an encoder, for images without encoder counts.
    pub(crate) fn check_without_encoder(&self, format: Format) -> Result<(), OpenError> {
        let (key, value) = match (self.encoder_counts, self.azimuth_source) {
            (Some(counts), _) => ("encoder_counts", counts.to_string()),
            (_, Some(source @ AzimuthSource::Encoder)) => ("azimuth_source", source.to_string()),
            _ => return Ok(()),
        };
        let reason = "its images have no encoder counts";
        Err(OpenError::option(Some(format), key, value, reason))
    }
}

/// Returns the options that are stored with a recording. Options given explicitly take precedence.
pub fn stored_options(root: &Path) -> Result<DatasetOptions, OpenError> {
    let places = [Some(root), root.parent()].into_iter().flatten();
    for path in places.map(|folder| folder.join(FILE)) {
        let text = match gyre_storage::read_text(&path, gyre_storage::SETTINGS) {
            Ok(text) => text,
            Err(error) => match error.kind() {
                ErrorKind::NotFound | ErrorKind::NotADirectory => continue,
                _ => return Err(OpenError::io(&path, error)),
            },
        };
        return toml::from_str(&text).map_err(|error| {
            let reason = reason(&text, &error);
            let fault = format!("does not hold keys of the section [dataset]: {reason}");
            OpenError::at(&path, fault)
        });
    }
    Ok(DatasetOptions::default())
}

fn reason(text: &str, error: &toml::de::Error) -> String {
    let before = error.span().and_then(|span| text.get(..span.start));
    let line = before.and_then(|before| before.rsplit('\n').next());
    let key = line.and_then(|line| Some(line.split_once('=')?.0.trim()));
    let plain = key.and_then(|key| in_plain_words(key, error.message()));
    plain.unwrap_or_else(|| error.message().to_owned())
}

#[cfg(test)]
mod tests {
    use std::fs;

    use super::*;

    #[test]
    fn options_are_read_from_the_root_and_from_the_folder_of_images() {
        let folder = tempfile::tempdir().unwrap();
        let images = folder.path().join("radar");
        fs::create_dir(&images).unwrap();
        assert_eq!(stored_options(&images).unwrap(), DatasetOptions::default());
        let text = "range_offset_m = -0.25\nencoder_counts = 3600\n";
        fs::write(folder.path().join(FILE), text).unwrap();
        let stored = DatasetOptions {
            range_offset_m: Some(-0.25),
            encoder_counts: Some(3600),
            ..Default::default()
        };
        assert_eq!(stored_options(folder.path()).unwrap(), stored);
        assert_eq!(stored_options(&images).unwrap(), stored);
        let explicit = DatasetOptions {
            range_offset_m: Some(0.5),
            ..Default::default()
        };
        let both = explicit.or(&stored);
        assert_eq!(both.range_offset_m, Some(0.5));
        assert_eq!(both.encoder_counts, Some(3600));
    }

    #[test]
    fn unknown_keys_are_rejected_by_name() {
        let folder = tempfile::tempdir().unwrap();
        let many = "encoder_counts is \"many\", but must be a whole number from 0 to 65535";
        for (text, expected) in [
            ("range_ofset_m = 1.0", "range_ofset_m"),
            ("# mine\nencoder_counts = 'many'", many),
        ] {
            fs::write(folder.path().join(FILE), text).unwrap();
            let error = stored_options(folder.path()).unwrap_err().to_string();
            assert!(error.contains("dataset.toml"), "{error}");
            assert!(error.contains(expected), "{error}");
        }
    }
}
