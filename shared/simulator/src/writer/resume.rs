//! The files of a dataset that is there: whether it can be resumed, and its removal.

use std::collections::BTreeSet;
use std::fs;
use std::io::ErrorKind;
use std::path::{Path, PathBuf};

use gyre_datasets::ImageSource as _;
use gyre_storage::{SETTINGS, StorageError, read_bytes, read_text};

use super::encode;
use crate::config::SimulationConfig;
use crate::error::SimulatorError;
use crate::simulated_drive::SimulatedDrive;

/// The file with the configuration that made a dataset.
pub const MADE_BY: &str = "simulation.toml";

/// The size of the largest image that is compared, bytes: twice the largest image of a radar.
const MAX_IMAGE_BYTES: u64 = 64 << 20;

/// The file with the options to read it; see [`gyre_datasets::open`].
pub(super) const DATASET_OPTIONS: &str = "dataset.toml";

pub(super) fn made_by(config: &SimulationConfig) -> Result<String, SimulatorError> {
    Ok(format!(
        "# The configuration that made this dataset.\n{}",
        to_toml(config)?
    ))
}

pub(super) fn dataset_options(drive: &SimulatedDrive) -> Result<String, SimulatorError> {
    to_toml(&drive.dataset_options())
}

fn to_toml(value: &impl serde::Serialize) -> Result<String, SimulatorError> {
    let expected = "a configuration that can be written as TOML";
    toml::to_string(value).map_err(|error| SimulatorError::key("simulation", error, expected))
}

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
    let made_by_this = match made_with(out)? {
        None => false,
        Some(found) if same_scans(&found) == same_scans(config) => true,
        Some(_) => return Err(other_dataset(out)),
    };
    let ours: BTreeSet<&str> = names.iter().map(String::as_str).collect();
    if let Some(other) = there
        .iter()
        .find(|name| !made_by_this || !ours.contains(name.as_str()))
    {
        return Err(super::in_use(&folder, other));
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

fn images(folder: &Path) -> Result<BTreeSet<String>, SimulatorError> {
    let listing = StorageError::at("list", folder);
    let mut names = BTreeSet::new();
    for entry in fs::read_dir(folder).map_err(&listing)? {
        let entry = entry.map_err(&listing)?;
        match gyre_storage::is_draft(&entry.path()) {
            true => gyre_storage::remove(&entry.path())?,
            false => _ = names.insert(entry.file_name().to_string_lossy().into_owned()),
        }
    }
    Ok(names)
}

/// The configuration that made the dataset in `out`; `None` if that is unknown.
fn made_with(out: &Path) -> Result<Option<SimulationConfig>, SimulatorError> {
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
    SimulatorError::OtherFiles(format!(
        "{} holds a dataset of another configuration (see its simulation.toml): choose another folder",
        out.display()
    ))
}

/// The configuration without the number of scans, which does not change the content of a scan.
fn same_scans(config: &SimulationConfig) -> SimulationConfig {
    SimulationConfig {
        scans: Some(1),
        ..config.clone()
    }
}

/// Checks an image against a newly rendered one: another build may render differently, and the file
/// may have been changed.
fn require_same(drive: &SimulatedDrive, index: usize, path: &Path) -> Result<(), SimulatorError> {
    let size = drive.image_size();
    let (mut pixels, mut encoded) = (vec![0; size.bytes()], Vec::new());
    drive.renderer().draw(index, &mut pixels);
    encode(path, size, &pixels, &mut encoded)?;
    let found = read_bytes(path, MAX_IMAGE_BYTES).map_err(StorageError::at("write", path))?;
    match found == encoded {
        true => Ok(()),
        false => Err(SimulatorError::OtherFiles(format!(
            "{} differs from the image that is rendered now: another build made it, or it was changed; choose another folder",
            path.display()
        ))),
    }
}

/// Removes the dataset in `folder` with the configuration that made it.
/// If the folder holds any other file, nothing is removed.
pub fn remove_dataset(folder: &Path) -> Result<(), SimulatorError> {
    let _alone = super::lock(folder)?;
    let found = files(folder)?;
    let ours = match made_with(folder)? {
        Some(config) => files_of(&SimulatedDrive::new(&config)?),
        None => BTreeSet::new(),
    };
    if let Some(other) = found
        .iter()
        .find(|path| !ours.contains(*path) && !gyre_storage::is_draft(path))
    {
        return Err(super::in_use(folder, &other.to_string_lossy()));
    }
    // The file that identifies the dataset is removed last.
    let (last, first): (Vec<_>, Vec<_>) = found
        .iter()
        .partition(|path| path.as_path() == Path::new(MADE_BY));
    for path in first.into_iter().chain(last).map(|path| folder.join(path)) {
        fs::remove_file(&path).map_err(StorageError::at("remove", &path))?;
    }
    Ok(())
}

fn files_of(drive: &SimulatedDrive) -> BTreeSet<PathBuf> {
    let images = (0..drive.scans())
        .map(|index| Path::new(drive.image_folder()).join(drive.image_name(index)));
    let beside = drive.side_files().into_iter().map(|(name, _)| name);
    let others = [MADE_BY, DATASET_OPTIONS];
    images
        .chain(beside.chain(others).map(PathBuf::from))
        .collect()
}

fn files(folder: &Path) -> Result<Vec<PathBuf>, SimulatorError> {
    let (mut files, mut folders) = (Vec::new(), vec![folder.to_owned()]);
    while let Some(next) = folders.pop() {
        let listing = StorageError::at("list", &next);
        for entry in fs::read_dir(&next).map_err(&listing)? {
            let entry = entry.map_err(&listing)?;
            match entry.file_type().map_err(&listing)?.is_dir() {
                true => folders.push(entry.path()),
                false => files.extend(entry.path().strip_prefix(folder).map(Path::to_owned)),
            }
        }
    }
    Ok(files)
}
