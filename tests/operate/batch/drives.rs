//! The list of a batch.

use std::{
    fs,
    path::{Path, PathBuf},
};

use tempfile::TempDir;

use super::Batch;
use crate::common::recording;

/// A list of drives, and the recordings in it.
pub(crate) struct Drives {
    pub(super) folder: TempDir,
    pub(super) names: Vec<String>,
}

impl Drives {
    pub fn new() -> Self {
        let folder = crate::common::folder();
        fs::write(folder.path().join("list.csv"), "name,drive,set\n").unwrap();
        Self {
            folder,
            names: Vec::new(),
        }
    }

    /// Parts of the small recording.
    pub fn recordings(mut self, parts: &[usize]) -> Self {
        for scans in parts {
            let kept = recording::linked(recording::small(), |scan| scan < *scans).keep();
            let place = self.path(&format!("part-{scans}"));
            fs::rename(kept, &place).unwrap();
            self = self.line(&format!("part-{scans}"), &place, "");
        }
        self
    }

    pub fn line(mut self, name: &str, drive: &Path, set: &str) -> Self {
        let list = self.path("list.csv");
        let lines = fs::read_to_string(&list).unwrap();
        let line = format!("{name},{},{set}\n", drive.display());
        fs::write(list, lines + &line).unwrap();
        self.names.push(name.to_owned());
        self
    }

    pub fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    /// The command with its results in a folder.
    pub fn batch(&self, out: &str) -> Batch<'_> {
        Batch {
            drives: self,
            out: self.path(out),
            options: Vec::new(),
        }
    }
}
