//! The place behind the newest messages of a recording.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};

use crate::Entry;

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
