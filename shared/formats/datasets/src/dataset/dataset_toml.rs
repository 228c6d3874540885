//! `dataset.toml`: options stored with a recording. Options given explicitly take precedence.

use std::io::ErrorKind;
use std::path::Path;

use super::{DatasetOptions, OpenError};
use crate::in_plain_words;

/// File name, beside the folder of images or in it.
const FILE: &str = "dataset.toml";

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
