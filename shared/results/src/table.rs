//! Tables as CSV.

use std::{
    fs::File,
    io::{self, Read},
    path::Path,
};

use csv::{Reader, ReaderBuilder, Trim};
use gyre_configuration::terminal::Failure;

/// The longest line, bytes: several times the length of a full row.
const LONGEST_LINE: usize = 1 << 16;

/// Opens a table of any length, which is read row by row.
pub(crate) fn open(path: &Path) -> Result<Reader<ShortLines<File>>, Failure> {
    let file = gyre_storage::open(path)
        .map_err(|error| format!("cannot read {}: {error}", path.display()))?;
    Ok(reader(file))
}

pub(crate) fn reader<R: Read>(text: R) -> Reader<ShortLines<R>> {
    let lines = ShortLines { text, line: 0 };
    ReaderBuilder::new().trim(Trim::All).from_reader(lines)
}

/// Refuses a line without end, which would be kept in memory.
pub(crate) struct ShortLines<R> {
    text: R,
    line: usize,
}

impl<R: Read> Read for ShortLines<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let count = self.text.read(bytes)?;
        for part in bytes[..count].split_inclusive(|byte| *byte == b'\n') {
            self.line += part.len();
            if self.line > LONGEST_LINE {
                let reason = format!("it has a line of more than {LONGEST_LINE} bytes");
                return Err(io::Error::new(io::ErrorKind::InvalidData, reason));
            }
            if part.ends_with(b"\n") {
                self.line = 0;
            }
        }
        Ok(count)
    }
}
