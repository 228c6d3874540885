//! A recording in several files: a file that is large or long enough is ended, and the next part
//! begun.

use std::path::PathBuf;

use bytemuck::pod_read_unaligned;
use gyre_contract::Item;

use crate::{
    Entry, Head, Incoming, Ledger, Positions, RecordingError, RecordingWriter, next_part,
    parts::part,
};

/// When a file is ended. The limits are checked before each message.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Split {
    /// The size, bytes; `None`: any. A file is larger by at most a chunk and its summary.
    pub bytes: Option<u64>,
    /// Time from its first to its newest scan on the sensor's clock, ns; `None`: any.
    pub span_ns: Option<i64>,
}

pub struct SplitWriter {
    /// The first part.
    to: PathBuf,
    head: Head,
    split: Split,
    /// The part that is being written, for records that are not messages.
    pub file: RecordingWriter,
    /// Stores the parts; `None` for a recording that nobody continues.
    ledger: Option<Ledger>,
    /// The positions behind all that was added.
    positions: Positions,
}

impl SplitWriter {
    /// Begins the part of the recording `to` given by `head`, behind `positions`.
    pub fn create(
        to: PathBuf,
        head: Head,
        split: Split,
        ledger: Option<Ledger>,
        positions: Positions,
    ) -> Result<Self, RecordingError> {
        if let Some(ledger) = &ledger {
            ledger.note(&to, &head, &positions)?;
        }
        Ok(Self {
            file: RecordingWriter::create(&part(&to, head.part), &head)?,
            to,
            head,
            split,
            ledger,
            positions,
        })
    }

    /// Adds a message, to the next part if this one is full.
    pub fn add(&mut self, message: &Incoming) -> Result<(), RecordingError> {
        let Split { bytes, span_ns } = self.split;
        let is_full = bytes.is_some_and(|bytes| self.file.bytes() >= bytes)
            || span_ns.is_some_and(|span_ns| self.file.span_ns() >= span_ns);
        if is_full {
            self.go_on()?;
        }
        self.file.add(message)?;
        if let Some(item) = message.header.get(..size_of::<Item>()) {
            let position = self.positions.entry(message.topic.to_owned()).or_default();
            position.pass(&Entry::of(&pod_read_unaligned(item)));
        }
        Ok(())
    }

    /// Ends the file and begins the next one. The ledger has no message that is not written, and
    /// each number before there is a file of it.
    fn go_on(&mut self) -> Result<(), RecordingError> {
        self.file.end()?;
        self.head.part = next_part(&self.to, self.head.part);
        if let Some(ledger) = &self.ledger {
            ledger.note(&self.to, &self.head, &self.positions)?;
        }
        let next = part(&self.to, self.head.part);
        self.file.go_on(&next, &self.head)
    }
}
