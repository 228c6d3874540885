//! The records of a file outside of its chunks, up to its end or to where its writer was killed.

use std::{
    fs::File,
    io::{self, Read, Seek, SeekFrom},
    path::Path,
};

use mcap::{
    MAGIC,
    records::{Metadata, Record, op},
};

use crate::RecordingError;

/// Bytes of opcode and length before each record.
pub(crate) const PREFIX: u64 = 9;

/// The place of a record in its file.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Span {
    /// Position of its opcode.
    pub offset: u64,
    /// Its length with opcode and length.
    pub bytes: u64,
}

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
    offset: u64,
    bytes: u64,
}

impl<'a> Walk<'a> {
    /// Begins behind the signature.
    pub fn new(path: &'a Path, file: &'a File) -> Result<Self, RecordingError> {
        let walk = Self {
            path,
            file,
            offset: MAGIC.len() as u64,
            bytes: file.metadata().map_err(|e| failed(path, e))?.len(),
        };
        match walk.read(0, MAGIC.len() as u64) {
            Ok(signature) if signature == MAGIC => Ok(walk),
            Err(error) if error.kind() != io::ErrorKind::UnexpectedEof => Err(failed(path, error)),
            _ => Err(RecordingError::Foreign {
                path: path.to_owned(),
                reason: "it does not begin with the signature of MCAP".to_owned(),
            }),
        }
    }

    /// Returns the next record; `None` where the file ends before its end.
    pub fn next(&mut self) -> Result<Option<Step>, RecordingError> {
        while let Some((opcode, span)) = self.record()? {
            self.offset = span.offset + span.bytes;
            match opcode {
                op::CHUNK => return Ok(Some(Step::Chunk(span))),
                op::DATA_END | op::FOOTER => return Ok(Some(Step::End)),
                op::METADATA => return self.metadata(span).map(Some),
                _ => {}
            }
        }
        Ok(None)
    }

    /// Returns the opcode and the place of the record here; `None` if it is not complete.
    fn record(&self) -> Result<Option<(u8, Span)>, RecordingError> {
        if self.bytes - self.offset < PREFIX {
            return Ok(None);
        }
        let prefix = self
            .read(self.offset, PREFIX)
            .map_err(|e| failed(self.path, e))?;
        let mut length = [0; 8];
        length.copy_from_slice(&prefix[1..]);
        let bytes = PREFIX.saturating_add(u64::from_le_bytes(length));
        let span = Span {
            offset: self.offset,
            bytes,
        };
        Ok((bytes <= self.bytes - self.offset).then_some((prefix[0], span)))
    }

    fn metadata(&self, span: Span) -> Result<Step, RecordingError> {
        let record = self
            .read(span.offset, span.bytes)
            .map_err(|e| failed(self.path, e))?;
        match mcap::parse_record(op::METADATA, &record[PREFIX as usize..]) {
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

    fn read(&self, offset: u64, bytes: u64) -> io::Result<Vec<u8>> {
        let mut file = self.file;
        file.seek(SeekFrom::Start(offset))?;
        // Not more than the file has, whatever its records say.
        let mut read = Vec::new();
        file.take(bytes).read_to_end(&mut read)?;
        match read.len() as u64 == bytes {
            true => Ok(read),
            false => Err(io::ErrorKind::UnexpectedEof.into()),
        }
    }
}

fn failed(path: &Path, source: io::Error) -> RecordingError {
    RecordingError::Io {
        path: path.to_owned(),
        source,
    }
}
