//! The records of a file outside of its chunks, up to its end or to where its writer was killed.

use std::{fs::File, io, path::Path};

use gyre_bags::damaged::Span;
use mcap::records::{Metadata, Record, op};

use crate::RecordingError;

/// Bytes of a record before its content: opcode and length.
const PREFIX: usize = 9;

/// A record that readers of recordings look at.
pub(crate) enum Step {
    Metadata(Metadata),
    Chunk(Span),
    /// The end of the data, as a writer leaves it that was not killed.
    End,
}

/// Walks over a file.
pub(crate) struct Walk<'a> {
    path: &'a Path,
    file: &'a File,
    records: gyre_bags::damaged::Walk<'a>,
}

impl<'a> Walk<'a> {
    /// Begins behind the signature.
    pub fn new(path: &'a Path, file: &'a File) -> Result<Self, RecordingError> {
        match gyre_bags::damaged::Walk::new(file) {
            Ok(Some(records)) => Ok(Self {
                path,
                file,
                records,
            }),
            Ok(None) => Err(RecordingError::Foreign {
                path: path.to_owned(),
                reason: "it does not begin with the signature of MCAP".to_owned(),
            }),
            Err(error) => Err(failed(path, error)),
        }
    }

    /// Returns the next record; `None` where the file ends before its end.
    pub fn next(&mut self) -> Result<Option<Step>, RecordingError> {
        while let Some((opcode, span)) = self.records.next().map_err(|e| failed(self.path, e))? {
            match opcode {
                op::CHUNK => return Ok(Some(Step::Chunk(span))),
                op::DATA_END | op::FOOTER => return Ok(Some(Step::End)),
                op::METADATA => return self.metadata(span).map(Some),
                _ => {}
            }
        }
        Ok(None)
    }

    fn metadata(&self, span: Span) -> Result<Step, RecordingError> {
        let record = gyre_bags::damaged::read(self.file, span).map_err(|e| failed(self.path, e))?;
        match gyre_bags::damaged::parse(op::METADATA, record.get(PREFIX..).unwrap_or_default()) {
            Ok(Record::Metadata(metadata)) => Ok(Step::Metadata(metadata)),
            parsed => Err(RecordingError::Damaged {
                path: self.path.to_owned(),
                offset: span.offset,
                reason: parsed
                    .err()
                    .map_or("it is no metadata".to_owned(), |e| e.to_string()),
            }),
        }
    }
}

fn failed(path: &Path, source: io::Error) -> RecordingError {
    RecordingError::Io {
        path: path.to_owned(),
        source,
    }
}
