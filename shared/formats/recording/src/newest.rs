//! The newest messages of one file, without a list of all of them in memory.

use std::path::Path;

use crate::{
    Head, RecordingError,
    position::Positions,
    table::Table,
    walk::{Step, Walk},
};

/// Reads the head of a file, and the positions behind its newest messages.
pub(crate) fn newest(path: &Path) -> Result<(Head, Positions), RecordingError> {
    let file = gyre_storage::open(path).map_err(|source| RecordingError::Io {
        path: path.to_owned(),
        source,
    })?;
    let (mut head, mut positions, mut has_chunk) = (None, Positions::new(), false);
    let mut walk = Walk::new(path, &file)?;
    while let Some(step) = walk.next()? {
        match step {
            Step::End => break,
            Step::Chunk(_) => has_chunk = true,
            Step::Channel(_) => {}
            Step::Metadata(_, record) => {
                if let Some(read) = Head::of_metadata(&record) {
                    head = read.ok();
                } else if let Some(table) = Table::of_metadata(&record).filter(|_| has_chunk) {
                    for (topic, entries) in table.entries {
                        let position = positions.entry(topic).or_default();
                        entries.iter().for_each(|entry| position.pass(entry));
                    }
                }
            }
        }
    }
    let head = head.ok_or_else(|| RecordingError::Foreign {
        path: path.to_owned(),
        reason: "it has no metadata `gyre.recording`".to_owned(),
    })?;
    Ok((head, positions))
}

/// Returns the head of a file; `None` if it is not that of a recording, or cannot be read.
pub(crate) fn head(path: &Path) -> Option<Head> {
    let file = gyre_storage::open(path).ok()?;
    let mut walk = Walk::new(path, &file).ok()?;
    // It is before all messages.
    while let Step::Metadata(_, record) = walk.next().ok()?? {
        if let Some(head) = Head::of_metadata(&record) {
            return head.ok();
        }
    }
    None
}
