//! The first metadata record of a file, the run that it is of; and the newest messages of one file,
//! without a list of all of them in memory.

use std::{collections::BTreeMap, path::Path};

use gyre_contract::topic;
use gyre_storage::quoted;
use mcap::records::{Metadata, op};
use serde::{Deserialize, Serialize};

use crate::{Entry, RecordingError, file::McapFile, table::Table};

const NAME: &str = "gyre.recording";
/// The reason against a file without it.
pub(crate) const NO_HEAD: &str = "it has no metadata `gyre.recording`";
/// The version of everything that this crate writes beside the wire messages, which carry versions
/// of their own.
const FORMAT: &str = "1";

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Head {
    /// Identifies the recording: all its parts have the same identifier.
    pub id: String,
    pub part: usize,
    /// The resolved configuration of the run, TOML.
    pub configuration: String,
    pub topics: Vec<String>,
    /// Bytes of the run's largest scan.
    pub scan_bytes: usize,
    /// `lossless` or `live`.
    pub mode: String,
}

impl Head {
    pub(crate) fn to_metadata(&self) -> Metadata {
        let entries = [
            ("format", FORMAT.to_owned()),
            ("id", self.id.clone()),
            ("part", self.part.to_string()),
            ("configuration", self.configuration.clone()),
            ("topics", types(&self.topics)),
            ("scan_bytes", self.scan_bytes.to_string()),
            ("mode", self.mode.clone()),
        ];
        Metadata {
            name: NAME.to_owned(),
            metadata: entries.map(|(key, value)| (key.to_owned(), value)).into(),
        }
    }

    /// Reads a record; `None` for a different record.
    pub(crate) fn of_metadata(record: &Metadata) -> Option<Result<Self, String>> {
        (record.name == NAME).then(|| Self::parse(&record.metadata))
    }

    fn parse(entries: &BTreeMap<String, String>) -> Result<Self, String> {
        let entry = |key: &str| {
            let missing = || format!("its metadata `{NAME}` has no `{key}`");
            entries.get(key).cloned().ok_or_else(missing)
        };
        let number = |key: &str| {
            let value = entry(key)?;
            value.parse().map_err(|_| {
                let value = quoted(&value);
                format!("`{key}` of its metadata `{NAME}` is {value}, not a number")
            })
        };
        let format = entry("format")?;
        if format != FORMAT {
            let format = quoted(&format);
            return Err(format!(
                "it has format {format}, and this version of Gyre reads {FORMAT}"
            ));
        }
        let topics = entry("topics")?;
        let topics = topics.split(',').filter(|topic| !topic.is_empty());
        Ok(Self {
            id: entry("id")?,
            part: number("part")?,
            configuration: entry("configuration")?,
            topics: topics.map(of_type).collect::<Result<_, _>>()?,
            scan_bytes: number("scan_bytes")?,
            mode: entry("mode")?,
        })
    }
}

fn types(topics: &[String]) -> String {
    let topics = topics.iter().filter_map(|name| topic(name));
    let types = topics.map(|topic| format!("{}={}", topic.name, topic.header.name));
    types.collect::<Vec<String>>().join(",")
}

/// Returns the topic of this type, which must be the type that this program has.
fn of_type(text: &str) -> Result<String, String> {
    let (name, of) = text.split_once('=').unwrap_or((text, ""));
    match topic(name).map(|topic| topic.header.name) {
        Some(own) if own == of => Ok(name.to_owned()),
        own => Err(format!(
            "its messages of topic {} are of type {}, and this version of Gyre reads `{}`",
            quoted(name),
            quoted(of),
            own.unwrap_or("none of it")
        )),
    }
}

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
