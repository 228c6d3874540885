//! The log of a live receiver of fixes, which grows.

use std::{
    io::Read,
    path::{Path, PathBuf},
};

use super::table::Rows;
use super::{LogError, SampleLog, kinds::Kind};
use gyre_geometry::samples::SampleKind;

const OF: SampleKind = SampleKind::Gnss;

/// The fixes that a live receiver has sent so far: each row of their log is read once.
pub struct ReceivedFixes {
    path: PathBuf,
    rows: Rows,
}

impl ReceivedFixes {
    pub fn read(path: &Path) -> Result<Self, LogError> {
        let mut bytes = Vec::new();
        let read = gyre_storage::open(path).and_then(|mut file| file.read_to_end(&mut bytes));
        read.map_err(|source| LogError::unreadable(OF, path, source))?;
        let rows = Rows::of(&String::from_utf8_lossy(&bytes), Kind::of(OF));
        Ok(Self {
            rows: rows.map_err(|reason| LogError::unknown(OF, path, reason))?,
            path: path.to_owned(),
        })
    }

    /// Takes the rows that have been appended.
    pub fn add(&mut self, rows: &str) {
        self.rows.go_on(rows);
    }

    pub fn count(&self) -> usize {
        self.rows.raw.entries.len()
    }

    pub fn log(&self) -> SampleLog {
        let form = self.rows.columns.form;
        SampleLog::examined(self.rows.raw.clone(), form, Kind::of(OF), &self.path)
    }
}
