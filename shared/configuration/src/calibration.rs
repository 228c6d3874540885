//! The constants that `gyre calibrate` has found, as overrides of a configuration.

use std::path::{Path, PathBuf};

use gyre_radar::DatasetOptions;
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

/// Returns the section `[dataset]` of a file of `gyre calibrate` as overrides `dataset.key=value`.
///
/// # Errors
/// A file that cannot be read, or has anything else.
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
    let section = match table.get("dataset") {
        Some(toml::Value::Table(section)) if table.len() == 1 => section,
        _ => {
            return Err(unusable(
                "a calibration has the section [dataset] and no other: give the calibration.toml of `gyre calibrate`".to_owned(),
            ));
        }
    };
    strict::section::<DatasetOptions>(&mut table.clone(), "dataset")
        .map_err(|error| unusable(error.to_string()))?;
    Ok(section
        .iter()
        .map(|(key, value)| format!("dataset.{key}={value}"))
        .collect())
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
        storage::write(
            &file,
            "[dataset]\ndoppler_s = 0.049\n[points]\nmin_range_m = 7\n",
        )
        .unwrap();
        let refused = overrides(&file).unwrap_err().to_string();
        assert!(
            refused.contains("the section [dataset] and no other"),
            "{refused}"
        );
    }
}
