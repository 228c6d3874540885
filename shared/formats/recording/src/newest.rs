//! The newest messages of one file, without a list of all of them in memory.

use std::{collections::BTreeMap, path::Path};

use mcap::records::op;
use serde::{Deserialize, Serialize};

use crate::{Entry, Head, RecordingError, file::McapFile, head::NO_HEAD, table::Table};

/// The place behind the newest message of a topic.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Position {
    pub next: u64,
    /// The generation of the newest one.
    pub generation: u32,
}

pub type Positions = BTreeMap<String, Position>;

impl Position {
    /// Goes behind a message. An older one may come again.
    pub(crate) fn pass(&mut self, entry: &Entry) {
        let next = entry.seq.saturating_add(1);
        if (entry.generation, next) > (self.generation, self.next) {
            (self.generation, self.next) = (entry.generation, next);
        }
    }
}

/// Reads the head of a file, and the positions behind its newest messages.
pub(crate) fn newest(path: &Path) -> Result<(Head, Positions), RecordingError> {
    let mut file = McapFile::open(path)?;
    let (mut head, mut positions, mut has_chunk) = (None, Positions::new(), false);
    while let Some((opcode, span)) = file.next_record()?
        && !file.is_complete
    {
        has_chunk |= opcode == op::CHUNK;
        let Some(record) = file.metadata(opcode, span)? else {
            continue;
        };
        if let Some(read) = Head::of_metadata(&record) {
            head = read.ok();
        } else if let Some(table) = Table::of_metadata(&record).filter(|_| has_chunk) {
            for (topic, entries) in table.entries {
                let position = positions.entry(topic).or_default();
                entries.iter().for_each(|entry| position.pass(entry));
            }
        }
    }
    let head = head.ok_or_else(|| RecordingError::foreign(path, NO_HEAD))?;
    Ok((head, positions))
}

/// Returns the head of a file; `None` if the file is not part of a recording, or is unreadable.
pub(crate) fn head(path: &Path) -> Option<Head> {
    let mut file = McapFile::open(path).ok()?;
    // It is before all messages.
    while let Some((opcode, span)) = file.next_record().ok()?
        && !matches!(opcode, op::CHUNK | op::CHANNEL | op::DATA_END | op::FOOTER)
    {
        let record = file.metadata(opcode, span).ok()?;
        if let Some(head) = record.as_ref().and_then(Head::of_metadata) {
            return head.ok();
        }
    }
    None
}
