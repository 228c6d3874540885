//! Readers on small generated datasets, valid and invalid: images and their series, the rows of a
//! sweep, formats and options.

mod formats;
mod images;
mod rows;
mod series;

use std::path::Path;

use crate::common::assert_refused;
use gyre_datasets::{Dataset, DatasetOptions, ReadError, open};
use gyre_geometry::OwnedScan;
use tempfile::TempDir;

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

fn opened(root: &Path) -> Box<dyn Dataset> {
    open(root, &DatasetOptions::default()).unwrap()
}

#[track_caller]
fn assert_rejected(root: &Path, words: &str) {
    assert_refused(open(root, &DatasetOptions::default()), words);
}

fn first_scan(root: &Path) -> Result<OwnedScan, ReadError> {
    opened(root).scan(0)
}

/// The default options with a change.
fn options(change: impl FnOnce(&mut DatasetOptions)) -> DatasetOptions {
    let mut options = DatasetOptions::default();
    change(&mut options);
    options
}

/// The first scan, read with a change of the default options.
fn first_scan_with(root: &Path, change: impl FnOnce(&mut DatasetOptions)) -> OwnedScan {
    open(root, &options(change)).unwrap().scan(0).unwrap()
}
