//! A recording in several files: a file that is large or long enough is ended, and the next part
//! begun.

use std::{collections::BTreeMap, path::PathBuf};

use crate::{Head, Incoming, LogLine, RecordingError, RecordingWriter, next_part};

/// When a file is ended. What it holds then is looked at before each message.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Split {
    /// The size, bytes; `None`: any. A file is larger by at most a chunk and its summary.
    pub bytes: Option<u64>,
    /// Time from its first to its newest scan on the sensor's clock, ns; `None`: any.
    pub span_ns: Option<i64>,
}

/// Writes the files of a recording.
pub struct SplitWriter {
    /// The first part.
    to: PathBuf,
    head: Head,
    split: Split,
    writer: RecordingWriter,
    /// Messages missed in the parts that are ended, by topic.
    missed: BTreeMap<String, u64>,
}

impl SplitWriter {
    /// Begins the part of the recording `to` that `head` says.
    ///
    /// # Errors
    /// As [`RecordingWriter::create`].
    pub fn create(to: PathBuf, head: Head, split: Split) -> Result<Self, RecordingError> {
        let (path, part) = next_part(&to);
        let head = Head { part, ..head };
        Ok(Self {
            writer: RecordingWriter::create(&path, &head)?,
            to,
            head,
            split,
            missed: BTreeMap::new(),
        })
    }

    /// Adds a message, to the next part if this one is full.
    ///
    /// # Errors
    /// As [`RecordingWriter::add`].
    pub fn add(&mut self, message: &Incoming) -> Result<(), RecordingError> {
        let Split { bytes, span_ns } = self.split;
        let is_full = bytes.is_some_and(|bytes| self.writer.bytes() >= bytes)
            || span_ns.is_some_and(|span_ns| self.writer.span_ns() >= span_ns);
        if is_full {
            self.go_on()?;
        }
        self.writer.add(message)
    }

    /// Ends the file and begins the next one.
    fn go_on(&mut self) -> Result<(), RecordingError> {
        let (path, part) = next_part(&self.to);
        self.head.part = part;
        let missed = self.writer.go_on(&path, &self.head)?;
        add(&mut self.missed, missed);
        Ok(())
    }

    /// Counts messages that were missed, without one after them.
    pub fn missed(&mut self, topic: &str, missed: u64) {
        self.writer.missed(topic, missed);
    }

    /// Adds a line of the log.
    ///
    /// # Errors
    /// As [`RecordingWriter::add`].
    pub fn add_log(&mut self, line: LogLine) -> Result<(), RecordingError> {
        self.writer.add_log(line)
    }

    /// Adds the health of the run.
    ///
    /// # Errors
    /// As [`RecordingWriter::add`].
    pub fn add_health(&mut self, json: &str, now_ns: i64) -> Result<(), RecordingError> {
        self.writer.add_health(json, now_ns)
    }

    /// Writes a chunk if one is due.
    ///
    /// # Errors
    /// As [`RecordingWriter::add`].
    pub fn flush_if_due(&mut self) -> Result<(), RecordingError> {
        self.writer.flush_if_due()
    }

    /// Ends the recording, and returns the number of messages missed, by topic.
    ///
    /// # Errors
    /// As [`RecordingWriter::add`].
    pub fn finish(mut self) -> Result<BTreeMap<String, u64>, RecordingError> {
        let missed = self.writer.finish()?;
        add(&mut self.missed, missed);
        Ok(self.missed)
    }
}

fn add(sum: &mut BTreeMap<String, u64>, missed: BTreeMap<String, u64>) {
    for (topic, count) in missed {
        *sum.entry(topic).or_default() += count;
    }
}
