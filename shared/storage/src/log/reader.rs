//! The reader of a log.

use std::path::Path;

use super::{LogError, LogMagic, records::Records};

/// Reads a log while another process may append to it. It needs 16 bytes of memory for each record.
#[derive(Debug)]
pub struct LogReader {
    records: Records,
}

impl LogReader {
    /// Opens a log and finds its complete records. One that does not exist yet is empty.
    pub fn open(path: &Path, magic: LogMagic) -> Result<Self, LogError> {
        let mut reader = Self {
            records: Records::new(path, magic),
        };
        reader.refresh()?;
        Ok(reader)
    }

    /// Looks for records that were appended or cut off meanwhile; returns the number of complete
    /// ones now. Only the headers of the new ones are read, and the bytes of those that may be
    /// damaged.
    pub fn refresh(&mut self) -> Result<usize, LogError> {
        self.records.refresh()?;
        Ok(self.len())
    }

    /// Returns the number of complete records at the last [`refresh`](Self::refresh).
    pub fn len(&self) -> usize {
        self.records.len()
    }

    /// Returns how many of the first records were known before the last [`refresh`](Self::refresh),
    /// and are the same. Fewer than were known if the process that appends was restarted and has
    /// cut some off; it may have appended others since.
    pub fn unchanged(&self) -> usize {
        self.records.unchanged()
    }

    /// Returns whether there were no records.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Reads a record, which replaces the content of `bytes`.
    ///
    /// # Panics
    /// There are no more than `index` records.
    pub fn read(&self, index: usize, bytes: &mut Vec<u8>) -> Result<(), LogError> {
        self.records.read(index, bytes)
    }

    /// Returns the error for a record that its reader cannot decode.
    pub fn malformed(&self, index: usize) -> LogError {
        self.records.malformed(index)
    }

    /// Reads at most `length` bytes of the start of a record, which replace the content of `bytes`.
    /// They are not checked: the checksum covers the whole record.
    ///
    /// # Panics
    /// There are no more than `index` records.
    pub fn read_start(
        &self,
        index: usize,
        length: usize,
        bytes: &mut Vec<u8>,
    ) -> Result<(), LogError> {
        self.records.read_start(index, length, bytes)
    }
}
