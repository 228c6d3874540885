use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

use gyre_storage::StorageError;

use super::resume::{DATASET_OPTIONS, MADE_BY, made_with};
use crate::error::SimulatorError;
use crate::simulated_drive::SimulatedDrive;

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
    // Earlier builds wrote the poses of all azimuths too.
    let others = [MADE_BY, DATASET_OPTIONS, "azimuth_poses.npy"];
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
