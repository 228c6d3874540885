//! Opens any source: a recording of a run, a bag of ROS 2, or a dataset of [`gyre_radar`].

use std::path::{Path, PathBuf};

use gyre_datasets::{Dataset, DatasetOptions, Format, OpenError};

use crate::{
    Recording,
    bags::{self, is_bag},
    parts::{first_part_in, parts},
    scans::Scans,
};

/// Returns whether a path names a recording of a run: its first file, or a folder that holds it and
/// no other one. A bag of ROS 2 is not a recording, although its files have the same format.
pub fn is_recording(path: &Path) -> bool {
    if is_bag(path) {
        return false;
    }
    let is_named = path.extension().is_some_and(|it| it == "mcap");
    is_named || first_part_in(path).is_some()
}

/// As [`gyre_datasets::open`].
pub fn open(root: &Path, options: &DatasetOptions) -> Result<Box<dyn Dataset>, OpenError> {
    if is_bag(root) {
        return bags::open(root, options);
    }
    match is_recording(root) {
        true => open_parts(&parts(root), root, options),
        false => gyre_datasets::open(root, options),
    }
}

/// As [`gyre_datasets::open_resolved`].
pub fn open_resolved(root: &Path, options: &DatasetOptions) -> Result<Box<dyn Dataset>, OpenError> {
    match is_recording(root) || is_bag(root) {
        true => open(root, options),
        false => gyre_datasets::open_resolved(root, options),
    }
}

/// As [`gyre_datasets::reopen`].
pub fn reopen(
    root: &Path,
    options: &DatasetOptions,
    format: Format,
    files: Vec<PathBuf>,
) -> Result<Box<dyn Dataset>, OpenError> {
    match format {
        Format::Mcap => open_parts(&files, root, options),
        Format::Ros2Bag => bags::reopen(root, options, files),
        _ => gyre_datasets::reopen(root, options, format, files),
    }
}

/// As [`gyre_datasets::stored_options`]: for a recording, the options of its run.
pub fn stored_options(root: &Path) -> Result<DatasetOptions, OpenError> {
    if is_bag(root) {
        return Ok(DatasetOptions {
            format: Some(Format::Ros2Bag),
            ..DatasetOptions::default()
        });
    }
    match is_recording(root) {
        true => recorded_options(&open_recording(root)?),
        false => gyre_datasets::stored_options(root),
    }
}

pub fn open_recording(root: &Path) -> Result<Recording, OpenError> {
    recording_of(&parts(root), root)
}

fn recording_of(paths: &[PathBuf], root: &Path) -> Result<Recording, OpenError> {
    if paths.is_empty() {
        let reason = format!("there is no recording {}", root.display());
        return Err(OpenError::Recording(reason));
    }
    Ok(Recording::open(paths)?)
}

fn open_parts(
    paths: &[PathBuf],
    root: &Path,
    options: &DatasetOptions,
) -> Result<Box<dyn Dataset>, OpenError> {
    options.check()?;
    let recording = recording_of(paths, root)?;
    let recorded = recorded_options(&recording)?;
    let scans = Scans::open(recording)?;
    scans.check(options, &recorded)?;
    Ok(Box::new(scans))
}

/// Returns the options of the recorded run: the section `[dataset]` of its configuration.
fn recorded_options(recording: &Recording) -> Result<DatasetOptions, OpenError> {
    let invalid = |error: toml::de::Error| {
        let reason = error.message();
        OpenError::Recording(format!(
            "the configuration in the recording is not one of Gyre: {reason}"
        ))
    };
    let mut table: toml::Table = recording.head().configuration.parse().map_err(invalid)?;
    let section = table.remove("dataset");
    let section = section.unwrap_or_else(|| toml::Table::new().into());
    let options: DatasetOptions = section.try_into().map_err(invalid)?;
    Ok(DatasetOptions {
        format: Some(Format::Mcap),
        ..options
    })
}
