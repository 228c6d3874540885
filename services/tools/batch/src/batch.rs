//! A batch: its drives, and the folder of their results.

use std::path::PathBuf;

use crate::{Drive, List, Settings};

/// A batch that is to be computed.
#[derive(Clone, Debug)]
pub struct Batch<'a> {
    /// The program `gyre`.
    pub program: PathBuf,
    /// The list.
    pub list: &'a List,
    /// Those of its drives that are computed.
    pub drives: Vec<Drive>,
    /// Their common settings.
    pub settings: Settings,
    /// The folder of the batch, an absolute path without links.
    pub out: PathBuf,
    /// Runs at once.
    pub jobs: usize,
}

impl Batch<'_> {
    /// Returns the folder of a drive's results.
    pub fn results(&self, drive: &Drive) -> PathBuf {
        self.out.join("drives").join(&drive.name)
    }
}
