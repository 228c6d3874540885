//! The records of a file outside of its chunks, up to its end or to where its writer was killed.

use std::{fs::File, io, path::Path};

use gyre_bags::damaged::Span;
use mcap::records::{Channel, Metadata, Record, op};

use crate::RecordingError;

/// Bytes of a record before its content: opcode and length.
const PREFIX: usize = 9;

/// A record that readers of recordings look at.
pub(crate) enum Step {
    Metadata(Span, Metadata),
    Chunk(Span),
    /// A channel that the end of the file lists.
    Channel(Channel),
    /// The end of the data, as a writer leaves it that was not killed.
    End,
}

/// Walks over a file.
pub(crate) struct Walk<'a> {
    path: &'a Path,
    file: &'a File,
    pub records: gyre_bags::damaged::Walk<'a>,
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

    /// Returns the next record that can be read; `None` where the file ends.
    pub fn next(&mut self) -> Result<Option<Step>, RecordingError> {
        while let Some((opcode, span)) = self.records.next().map_err(|e| failed(self.path, e))? {
            match opcode {
                op::CHUNK => return Ok(Some(Step::Chunk(span))),
                op::DATA_END | op::FOOTER => return Ok(Some(Step::End)),
                op::METADATA | op::CHANNEL => {
                    let record = gyre_bags::damaged::read(self.file, span);
                    let record = record.map_err(|e| failed(self.path, e))?;
                    let body = record.get(PREFIX..).unwrap_or_default();
                    match gyre_bags::damaged::parse(opcode, body) {
                        Ok(Record::Metadata(record)) => {
                            return Ok(Some(Step::Metadata(span, record)));
                        }
                        Ok(Record::Channel(channel)) => return Ok(Some(Step::Channel(channel))),
                        _ => {
                            self.records.damage.insert(span.offset);
                        }
                    }
                }
                _ => {}
            }
        }
        Ok(None)
    }
}

fn failed(path: &Path, source: io::Error) -> RecordingError {
    RecordingError::Io {
        path: path.to_owned(),
        source,
    }
}
