//! The constants that `gyre calibrate` has found, as overrides of a configuration.

use std::path::{Path, PathBuf};

use gyre_datasets::DatasetOptions;
use gyre_samples::{GyroConfig, WheelsConfig};
use gyre_storage as storage;
use thiserror::Error;

use crate::strict::{self, syntax};

/// Why a file is no calibration.
#[derive(Debug, Error)]
#[error("{}: {reason}", file.display())]
pub struct CalibrationError {
    file: PathBuf,
    reason: String,
}

/// The sections where a calibration may have any key: radar, gyro and wheels.
const WHOLE: [&str; 3] = ["dataset", "gyro", "wheels"];
/// The sections whose key `min_range_m` a calibration may have.
const RANGES: [&str; 2] = ["points", "raster"];

/// Returns the constants in a file of `gyre calibrate` as overrides, as `dataset.key=value`.
pub fn overrides(file: &Path) -> Result<Vec<String>, CalibrationError> {
    let unusable = |reason: String| CalibrationError {
        file: file.to_owned(),
        reason,
    };
    let text = storage::read_text(file, storage::SETTINGS)
        .map_err(|error| unusable(format!("cannot be read: {error}")))?;
    let table: toml::Table = text
        .parse()
        .map_err(|error: toml::de::Error| unusable(syntax(&text, &error)))?;
    let is_known = |(section, value): (&String, &toml::Value)| match value {
        toml::Value::Table(_) if WHOLE.contains(&section.as_str()) => true,
        toml::Value::Table(keys) => {
            RANGES.contains(&section.as_str()) && keys.keys().all(|key| key == "min_range_m")
        }
        _ => false,
    };
    if !WHOLE.iter().any(|section| table.contains_key(*section)) || !table.iter().all(is_known) {
        return Err(unusable(
            "a calibration has the sections [dataset], [gyro] and [wheels], min_range_m in [points] and [raster], and no more: give the calibration.toml of `gyre calibrate`".to_owned(),
        ));
    }
    let mut sections = table.clone();
    strict::section::<DatasetOptions>(&mut sections, "dataset")
        .map_err(|error| unusable(error.to_string()))?;
    strict::section::<GyroConfig>(&mut sections, "gyro")
        .map_err(|error| unusable(error.to_string()))?;
    strict::section::<WheelsConfig>(&mut sections, "wheels")
        .map_err(|error| unusable(error.to_string()))?;
    let sections = table
        .iter()
        .filter_map(|(name, section)| Some((name, section.as_table()?)));
    let keys = sections.flat_map(|(name, section)| {
        let key = move |(key, value): (&String, &toml::Value)| format!("{name}.{key}={value}");
        section.iter().map(key)
    });
    Ok(keys.collect())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_calibration_overrides_the_dataset_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("calibration.toml");
        storage::write(
            &file,
            "[dataset]\nrange_offset_m = -0.31 # m\ndoppler_s = 0.049\n",
        )
        .unwrap();
        let mut keys = overrides(&file).unwrap();
        keys.sort();
        assert_eq!(
            keys,
            ["dataset.doppler_s=0.049", "dataset.range_offset_m=-0.31"]
        );
        let text = "[dataset]\n[points]\nmin_range_m = 7.5\n[raster]\nmin_range_m = 7.5\n";
        storage::write(&file, text).unwrap();
        let ranges = ["points.min_range_m=7.5", "raster.min_range_m=7.5"];
        assert_eq!(overrides(&file).unwrap(), ranges);
        let text = "[gyro]\nkind = \"auto\"\nup = \"-z\"\ndelay_s = 1.58\n";
        storage::write(&file, text).unwrap();
        let gyro = ["gyro.delay_s=1.58", "gyro.kind=\"auto\"", "gyro.up=\"-z\""];
        assert_eq!(overrides(&file).unwrap(), gyro);
        let text = "[wheels]\nkind = \"auto\"\ndelay_s = 0.35\n";
        storage::write(&file, text).unwrap();
        let wheels = ["wheels.delay_s=0.35", "wheels.kind=\"auto\""];
        assert_eq!(overrides(&file).unwrap(), wheels);
        for text in [
            "[dataset]\n[points]\nbeam_deg = 3\n",
            "[points]\nmin_range_m = 7\n",
        ] {
            storage::write(&file, text).unwrap();
            let refused = overrides(&file).unwrap_err().to_string();
            assert!(refused.contains("and no more"), "{refused}");
        }
        storage::write(&file, "[gyro]\nlate = 1.58\n").unwrap();
        let refused = overrides(&file).unwrap_err().to_string();
        assert!(refused.contains("late"), "{refused}");
    }
}
