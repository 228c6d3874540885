//! `dataset.toml`: what a recording says of itself.
//!
//! Calibration belongs to a radar, so it is best kept beside what the radar recorded: range offset, Doppler's shift, the encoder's
//! eccentricity. Simulated recordings come with it. What the reader is told explicitly counts more.

use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use super::{DatasetOptions, OpenError};

/// The file, in the dataset's folder, beside the folder of images or in it.
const FILE: &str = "dataset.toml";

/// What lies at or above a dataset's root; nothing where nothing lies there.
pub(super) fn options(root: &Path) -> Result<DatasetOptions, OpenError> {
    let places = [Some(root), root.parent()].into_iter().flatten();
    for path in places.map(|folder| folder.join(FILE)) {
        let text = match fs::read_to_string(&path) {
            Ok(text) => text,
            Err(error)
                if matches!(error.kind(), ErrorKind::NotFound | ErrorKind::NotADirectory) =>
            {
                continue;
            }
            Err(source) => return Err(OpenError::Io { path, source }),
        };
        let wrong = |error: toml::de::Error| OpenError::Told {
            path: path.clone(),
            reason: error.message().to_owned(),
        };
        return toml::from_str(&text).map_err(wrong);
    }
    Ok(DatasetOptions::default())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use super::*;

    #[test]
    fn a_recording_is_heard_from_its_folder_and_from_that_of_its_images() {
        let folder = tempfile::tempdir().unwrap();
        let images = folder.path().join("radar");
        fs::create_dir(&images).unwrap();
        assert_eq!(options(&images).unwrap(), DatasetOptions::default());
        fs::write(
            folder.path().join(FILE),
            "range_offset_m = -0.25\nencoder_counts = 3600\n",
        )
        .unwrap();
        let told = DatasetOptions {
            range_offset_m: Some(-0.25),
            encoder_counts: Some(3600),
            ..Default::default()
        };
        assert_eq!(options(folder.path()).unwrap(), told);
        assert_eq!(options(&images).unwrap(), told);
        let mine = DatasetOptions {
            range_offset_m: Some(0.5),
            ..Default::default()
        };
        assert_eq!(
            mine.or(&told),
            DatasetOptions {
                range_offset_m: Some(0.5),
                ..told
            }
        );
    }

    #[test]
    fn a_slip_in_it_is_told_by_name() {
        let folder = tempfile::tempdir().unwrap();
        fs::write(folder.path().join(FILE), "range_ofset_m = 1.0").unwrap();
        let error = options(folder.path()).unwrap_err().to_string();
        assert!(
            error.contains("dataset.toml") && error.contains("range_ofset_m"),
            "{error}"
        );
    }
}
