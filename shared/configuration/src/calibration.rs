//! The constants that `gyre calibrate` has found, as overrides of a configuration.

use std::path::Path;

use gyre_datasets::DatasetOptions;
use gyre_geometry::samples::{GyroConfig, WheelsConfig};
use gyre_storage as storage;

use crate::{ConfigurationError, strict};

/// The sections where a calibration may have any key: radar, gyro and wheels.
const WHOLE: [&str; 3] = ["dataset", "gyro", "wheels"];
/// The sections whose key `min_range_m` a calibration may have.
const RANGES: [&str; 2] = ["points", "raster"];

/// Returns the constants in a file of `gyre calibrate` as overrides, as `dataset.key=value`.
pub fn overrides(file: &Path) -> Result<Vec<String>, ConfigurationError> {
    let unusable = |reason: &str| ConfigurationError(format!("{}: {reason}", file.display()));
    let text = storage::read_text(file, storage::SETTINGS)
        .map_err(|error| unusable(&format!("cannot be read: {error}")))?;
    let table = strict::parse(file, &text)?;
    let is_known = |(section, value): (&String, &toml::Value)| match value {
        toml::Value::Table(_) if WHOLE.contains(&section.as_str()) => true,
        toml::Value::Table(keys) => {
            RANGES.contains(&section.as_str()) && keys.keys().all(|key| key == "min_range_m")
        }
        _ => false,
    };
    if !WHOLE.iter().any(|section| table.contains_key(*section)) || !table.iter().all(is_known) {
        return Err(unusable(
            "a calibration has the sections [dataset], [gyro] and [wheels], min_range_m in [points] and [raster], and no more: give the calibration.toml of `gyre calibrate`",
        ));
    }
    let mut sections = table.clone();
    let dataset = strict::section::<DatasetOptions>(&mut sections, "dataset").map(drop);
    let gyro = strict::section::<GyroConfig>(&mut sections, "gyro").map(drop);
    let wheels = strict::section::<WheelsConfig>(&mut sections, "wheels").map(drop);
    dataset
        .and(gyro)
        .and(wheels)
        .map_err(|error| unusable(&error.to_string()))?;
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
    use super::*;

    #[test]
    fn a_calibration_overrides_the_dataset_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let file = folder.path().join("calibration.toml");
        let of = |text: &str| {
            storage::write(&file, text).unwrap();
            overrides(&file)
        };
        for (text, expected) in [
            (
                "[dataset]\nrange_offset_m = -0.31 # m\ndoppler_s = 0.049\n",
                "dataset.doppler_s=0.049 dataset.range_offset_m=-0.31",
            ),
            (
                "[dataset]\n[points]\nmin_range_m = 7.5\n[raster]\nmin_range_m = 7.5\n",
                "points.min_range_m=7.5 raster.min_range_m=7.5",
            ),
            (
                "[gyro]\nkind = \"auto\"\nup = \"-z\"\ndelay_s = 1.58\n",
                "gyro.delay_s=1.58 gyro.kind=\"auto\" gyro.up=\"-z\"",
            ),
            (
                "[wheels]\nkind = \"auto\"\ndelay_s = 0.35\n",
                "wheels.delay_s=0.35 wheels.kind=\"auto\"",
            ),
        ] {
            let mut keys = of(text).unwrap();
            keys.sort();
            assert_eq!(keys.join(" "), expected);
        }
        for (text, words) in [
            ("[dataset]\n[points]\nbeam_deg = 3\n", "and no more"),
            ("[points]\nmin_range_m = 7\n", "and no more"),
            ("[gyro]\nlate = 1.58\n", "late"),
        ] {
            let refused = of(text).unwrap_err().to_string();
            assert!(refused.contains(words), "{refused}");
        }
    }
}
