//! The first metadata record of a file: the run that it is of.

use std::collections::BTreeMap;

use gyre_contract::topic;
use gyre_storage::quoted;
use mcap::records::Metadata;

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
