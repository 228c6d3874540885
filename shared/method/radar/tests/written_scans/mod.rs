//! Readers on small generated datasets, valid and invalid: images, the rows of a sweep, formats and
//! options.

mod formats;
mod images;
mod rows;

use std::path::Path;

use crate::common::read;
use gyre_radar::{Dataset, DatasetOptions, OpenError, OwnedScan, ReadError, open};
use tempfile::TempDir;

fn folder() -> TempDir {
    tempfile::tempdir().unwrap()
}

fn opened(root: &Path) -> Box<dyn Dataset> {
    open(root, &DatasetOptions::default()).unwrap()
}

fn rejected(root: &Path) -> OpenError {
    open(root, &DatasetOptions::default()).err().unwrap()
}

fn first_scan(root: &Path) -> Result<OwnedScan, ReadError> {
    read(opened(root).as_mut(), 0)
}
