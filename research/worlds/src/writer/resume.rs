//! Decides whether a folder can be resumed, and which scans it lacks.

use std::collections::BTreeSet;
use std::fs;
use std::io::ErrorKind;
use std::path::Path;

use gyre_datasets::ImageSource as _;
use gyre_storage::{SETTINGS, StorageError, read_bytes, read_text};

use crate::config::SimulationConfig;
use crate::error::SimulatorError;
use crate::image::encode;
use crate::simulated_drive::SimulatedDrive;

/// The file with the configuration that made a dataset.
pub const MADE_BY: &str = "simulation.toml";

/// The largest image that is compared, bytes: twice what a radar's image may have.
const MAX_IMAGE_BYTES: u64 = 64 << 20;

/// The file with the options to read it; see [`gyre_datasets::open`].
pub(super) const DATASET_OPTIONS: &str = "dataset.toml";

/// Content of [`MADE_BY`].
pub(super) fn made_by(config: &SimulationConfig) -> Result<String, SimulatorError> {
    Ok(format!(
        "# The configuration that made this dataset.\n{}",
        to_toml(config)?
    ))
}

/// Content of [`DATASET_OPTIONS`].
pub(super) fn dataset_options(drive: &SimulatedDrive) -> Result<String, SimulatorError> {
    to_toml(&drive.dataset_options())
}

fn to_toml(value: &impl serde::Serialize) -> Result<String, SimulatorError> {
    toml::to_string(value).map_err(|error| SimulatorError::Config {
        key: "simulation",
        value: error.to_string(),
        expected: "a configuration that can be written as TOML".to_owned(),
    })
}

/// Returns the scans that `out` lacks.
///
/// # Errors
/// [`SimulatorError`] if `out` holds images of another dataset, or images that differ from what is
/// rendered now.
pub(super) fn missing(
    drive: &SimulatedDrive,
    config: &SimulationConfig,
    out: &Path,
) -> Result<Vec<usize>, SimulatorError> {
    let folder = out.join(drive.image_folder());
    let names: Vec<String> = (0..drive.scans())
        .map(|index| drive.image_name(index))
        .collect();
    let there = images(&folder)?;
    let made_by_this = made_by_this(config, out)?;
    let ours: BTreeSet<&str> = names.iter().map(String::as_str).collect();
    if let Some(other) = there
        .iter()
        .find(|name| !made_by_this || !ours.contains(name.as_str()))
    {
        return Err(SimulatorError::OutputInUse {
            folder,
            other: other.clone(),
        });
    }
    let (kept, missing): (Vec<usize>, Vec<usize>) =
        (0..names.len()).partition(|&i| there.contains(&names[i]));
    let ends = kept
        .first()
        .into_iter()
        .chain(kept.last().filter(|_| kept.len() > 1));
    ends.copied()
        .try_for_each(|index| require_same(drive, index, &folder.join(&names[index])))?;
    Ok(missing)
}

/// Lists the complete images and removes incomplete ones.
fn images(folder: &Path) -> Result<BTreeSet<String>, SimulatorError> {
    let listing = |source| SimulatorError::List {
        folder: folder.to_owned(),
        source,
    };
    let mut names = BTreeSet::new();
    for entry in fs::read_dir(folder).map_err(listing)? {
        let entry = entry.map_err(listing)?;
        match gyre_storage::is_draft(&entry.path()) {
            true => fs::remove_file(entry.path()).map_err(SimulatorError::write(&entry.path()))?,
            false => _ = names.insert(entry.file_name().to_string_lossy().into_owned()),
        }
    }
    Ok(names)
}

/// Returns whether `out` was made by `config`, up to the number of scans and how they are played;
/// false if it does not say.
fn made_by_this(config: &SimulationConfig, out: &Path) -> Result<bool, SimulatorError> {
    match made_with(out)? {
        None => Ok(false),
        Some(found) if same_scans(&found) == same_scans(config) => Ok(true),
        Some(_) => Err(other_dataset(out)),
    }
}

/// The configuration that made the dataset in `out`; `None` if it does not say.
pub(super) fn made_with(out: &Path) -> Result<Option<SimulationConfig>, SimulatorError> {
    let path = out.join(MADE_BY);
    match read_text(&path, SETTINGS) {
        Ok(text) => toml::from_str(&text)
            .map(Some)
            .map_err(|_| other_dataset(out)),
        Err(error) if error.kind() == ErrorKind::NotFound => Ok(None),
        Err(source) => Err(StorageError::at("read", &path)(source).into()),
    }
}

fn other_dataset(out: &Path) -> SimulatorError {
    SimulatorError::OtherDataset {
        folder: out.to_owned(),
    }
}

/// The configuration without the keys that do not change the content of a scan.
fn same_scans(config: &SimulationConfig) -> SimulationConfig {
    SimulationConfig {
        scans: Some(1),
        ..config.resolved()
    }
}

/// Checks an image against a newly rendered one: another build may render differently, and the file
/// may have been changed.
fn require_same(drive: &SimulatedDrive, index: usize, path: &Path) -> Result<(), SimulatorError> {
    let size = drive.image_size();
    let (mut pixels, mut encoded) = (vec![0; size.bytes()], Vec::new());
    drive.renderer().draw(index, &mut pixels);
    encode(size, &pixels, &mut encoded).map_err(|source| SimulatorError::Encode {
        path: path.to_owned(),
        source,
    })?;
    let found = read_bytes(path, MAX_IMAGE_BYTES).map_err(SimulatorError::write(path))?;
    match found == encoded {
        true => Ok(()),
        false => Err(SimulatorError::OtherImage {
            path: path.to_owned(),
        }),
    }
}
