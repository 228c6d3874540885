//! A recording in several files: a file that is large or long enough is ended, and the next part
//! begun.

use std::{
    collections::BTreeMap,
    path::{Path, PathBuf},
};

use bytemuck::pod_read_unaligned;
use gyre_messages::Item;

use crate::{
    Entry, Head, Incoming, Ledger, LogLine, Positions, RecordingError, RecordingWriter, next_part,
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
    writer: RecordingWriter,
    /// Stores the parts; `None` for a recording that nobody continues.
    ledger: Option<Ledger>,
    /// The positions behind all that was added.
    positions: Positions,
    /// Messages missed in the parts that are ended, by topic.
    missed: BTreeMap<String, u64>,
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
            writer: RecordingWriter::create(&part(&to, head.part), &head)?,
            to,
            head,
            split,
            ledger,
            positions,
            missed: BTreeMap::new(),
        })
    }

    pub fn path(&self) -> &Path {
        &self.writer.path
    }

    /// Adds a message, to the next part if this one is full.
    pub fn add(&mut self, message: &Incoming) -> Result<(), RecordingError> {
        let Split { bytes, span_ns } = self.split;
        let is_full = bytes.is_some_and(|bytes| self.writer.bytes() >= bytes)
            || span_ns.is_some_and(|span_ns| self.writer.span_ns() >= span_ns);
        if is_full {
            self.go_on()?;
        }
        self.writer.add(message)?;
        if let Some(item) = message.header.get(..size_of::<Item>()) {
            let position = self.positions.entry(message.topic.to_owned()).or_default();
            position.pass(&Entry::of(&pod_read_unaligned(item)));
        }
        Ok(())
    }

    /// Ends the file and begins the next one. The ledger has no message that is not written, and
    /// each number before there is a file of it.
    fn go_on(&mut self) -> Result<(), RecordingError> {
        self.writer.end()?;
        self.head.part = next_part(&self.to, self.head.part);
        if let Some(ledger) = &self.ledger {
            ledger.note(&self.to, &self.head, &self.positions)?;
        }
        let next = part(&self.to, self.head.part);
        let missed = self.writer.go_on(&next, &self.head)?;
        add(&mut self.missed, missed);
        Ok(())
    }

    pub fn missed(&mut self, topic: &str, missed: u64) {
        self.writer.missed(topic, missed);
    }

    pub fn add_log(&mut self, line: LogLine) -> Result<(), RecordingError> {
        self.writer.add_log(line)
    }

    pub fn add_health(&mut self, json: &str, now_ns: i64) -> Result<(), RecordingError> {
        self.writer.add_health(json, now_ns)
    }

    pub fn flush_if_due(&mut self) -> Result<(), RecordingError> {
        self.writer.flush_if_due()
    }

    /// Ends the recording, and returns the number of messages missed, by topic.
    pub fn finish(self) -> Result<BTreeMap<String, u64>, RecordingError> {
        let mut sum = self.missed;
        add(&mut sum, self.writer.finish()?);
        Ok(sum)
    }
}

fn add(sum: &mut BTreeMap<String, u64>, missed: BTreeMap<String, u64>) {
    for (topic, count) in missed {
        *sum.entry(topic).or_default() += count;
    }
}
