//! The metadata record behind each chunk: its messages, and the messages missed so far.

use std::{collections::BTreeMap, fmt::Write};

use gyre_contract::{GivenAnew, Item};
use mcap::records::Metadata;

const NAME: &str = "gyre.table";
/// Before the name of a topic: the number of its messages that were missed, since the file was
/// begun.
const MISSED: &str = "missed.";

/// A message of a chunk.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Entry {
    pub seq: u64,
    pub scan: u64,
    /// The time of its scan, ns since 1970.
    pub stamp_ns: i64,
    pub generation: u32,
    pub numbered_from: u64,
}

impl Entry {
    pub(crate) fn given_anew(&self) -> GivenAnew {
        GivenAnew {
            generation: self.generation,
            first: self.numbered_from,
        }
    }

    pub(crate) fn of(item: &Item) -> Self {
        Self {
            seq: item.seq,
            scan: item.scan,
            stamp_ns: item.stamp_ns,
            generation: item.generation,
            numbered_from: item.numbered_from,
        }
    }
}

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Table {
    pub entries: BTreeMap<String, Vec<Entry>>,
    /// Messages missed since the file was begun, by topic.
    pub missed: BTreeMap<String, u64>,
}

impl Table {
    pub fn to_metadata(&self) -> Metadata {
        let mut metadata = BTreeMap::new();
        for (topic, entries) in &self.entries {
            let mut row = String::new();
            for it in entries {
                let _ = write!(row, "{}:{}:{}", it.seq, it.scan, it.stamp_ns);
                if it.generation > 0 {
                    let _ = write!(row, ":{}:{}", it.generation, it.numbered_from);
                }
                row.push(' ');
            }
            metadata.insert(topic.clone(), row);
        }
        for (topic, missed) in &self.missed {
            metadata.insert(format!("{MISSED}{topic}"), missed.to_string());
        }
        let name = NAME.to_owned();
        Metadata { name, metadata }
    }

    /// Returns whether a record is a table, be it a damaged one.
    pub fn is_of(record: &Metadata) -> bool {
        record.name == NAME
    }

    /// Reads a record; `None` for a different record, or an invalid table.
    pub fn of_metadata(record: &Metadata) -> Option<Self> {
        if !Self::is_of(record) {
            return None;
        }
        let mut table = Self::default();
        for (key, value) in &record.metadata {
            match key.strip_prefix(MISSED) {
                Some(topic) => {
                    table.missed.insert(topic.to_owned(), value.parse().ok()?);
                }
                None => {
                    let entries: Option<Vec<Entry>> = value.split_whitespace().map(entry).collect();
                    table.entries.insert(key.clone(), entries?);
                }
            }
        }
        Some(table)
    }
}

fn entry(text: &str) -> Option<Entry> {
    let mut numbers = text.split(':');
    let mut entry = Entry {
        seq: numbers.next()?.parse().ok()?,
        scan: numbers.next()?.parse().ok()?,
        stamp_ns: numbers.next()?.parse().ok()?,
        ..Entry::default()
    };
    if let Some(generation) = numbers.next() {
        entry.generation = generation.parse().ok()?;
        entry.numbered_from = numbers.next()?.parse().ok()?;
    }
    numbers.next().is_none().then_some(entry)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_is_read_as_it_was_written_and_anything_else_is_none() {
        let entry = |seq, stamp_ns, generation| Entry {
            seq,
            scan: seq + 5,
            stamp_ns,
            generation,
            numbered_from: u64::from(generation),
        };
        let entries = vec![entry(0, -1, 0), entry(1, i64::MAX, 0), entry(2, 7, 3)];
        let table = Table {
            entries: [("scan".to_owned(), entries)].into(),
            missed: [("masked".to_owned(), 7)].into(),
        };
        let mut record = table.to_metadata();
        assert_eq!(Table::of_metadata(&record), Some(table));
        for wrong in ["1:2", "1:2:3:4", "1:2:3:4:5:6", "a:1:2", "-1:2:3"] {
            record.metadata.insert("scan".to_owned(), wrong.to_owned());
            assert_eq!(Table::of_metadata(&record), None, "{wrong}");
        }
    }
}
