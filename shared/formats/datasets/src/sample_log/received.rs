//! The log of a live receiver of fixes, which grows.

use std::{
    io::{self, Read, Seek, SeekFrom},
    path::{Path, PathBuf},
};

use super::table::{Raw, Rows};
use super::{Form, LogError, SampleLog, kinds::Kind};
use gyre_geometry::samples::SampleKind;

const OF: SampleKind = SampleKind::Gnss;

/// The fixes that a live receiver has sent so far: each row of their log is read once.
pub struct ReceivedFixes {
    path: PathBuf,
    end: u64,
    rows: Option<Rows>,
}

impl ReceivedFixes {
    pub fn new(path: &Path) -> Self {
        Self {
            path: path.to_owned(),
            end: 0,
            rows: None,
        }
    }

    pub fn read_on(&mut self) -> Result<(), LogError> {
        let bytes = self.appended();
        let bytes = bytes.map_err(|source| LogError::unreadable(OF, &self.path, source))?;
        let text = String::from_utf8_lossy(&bytes);
        match &mut self.rows {
            Some(rows) => rows.go_on(&text),
            None => {
                let rows = Rows::of(&text, Kind::of(OF));
                self.rows = Some(rows.map_err(|e| LogError::unknown(OF, &self.path, e))?);
            }
        }
        self.end += bytes.len() as u64;
        Ok(())
    }

    pub fn count(&self) -> usize {
        self.rows.as_ref().map_or(0, |rows| rows.raw.entries.len())
    }

    pub fn log(&self) -> SampleLog {
        let rows = self.rows.clone();
        let (raw, form) = rows.map_or((Raw::default(), Form::default()), |rows| {
            (rows.raw, rows.columns.form)
        });
        SampleLog::examined(raw, form, Kind::of(OF), &self.path)
    }

    fn appended(&self) -> io::Result<Vec<u8>> {
        let mut file = gyre_storage::open(&self.path)?;
        file.seek(SeekFrom::Start(self.end))?;
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes)?;
        Ok(bytes)
    }
}
