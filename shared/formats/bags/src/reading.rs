//! The messages of a span.

use std::{
    collections::BTreeMap,
    fs::File,
    io,
    path::{Path, PathBuf},
};

use crate::damaged::{Damage, Span, sentence};
use mcap::{McapError, records::Record};

use crate::{
    BagError,
    files::compressed,
    spans::{TimedSpan, spans},
};

/// The largest number of channels and of schemas of a file, the longest name of a topic, and what
/// is kept of a schema, bytes.
const MAX_CHANNELS: usize = 4096;
const MAX_NAME_BYTES: usize = 1024;
const MAX_SCHEMA_BYTES: usize = 4096;
/// The start of what zstd has compressed. No message in CDR begins so.
const ZSTD: [u8; 4] = [0x28, 0xb5, 0x2f, 0xfd];

/// A channel of a file.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub(crate) struct Channel {
    pub topic: String,
    /// The type, such as `nav_msgs/msg/Odometry`.
    pub type_name: String,
    /// The type's definition.
    pub schema: String,
    /// The encoding of its messages.
    pub encoding: String,
}

/// A message.
#[derive(Clone, Debug)]
pub(crate) struct Message {
    pub channel: u16,
    /// When it was received, ns since 1970.
    pub log_ns: i64,
    pub data: Vec<u8>,
}

/// A file of a bag.
#[derive(Debug)]
pub(crate) struct BagFile {
    pub path: PathBuf,
    file: File,
    schemas: BTreeMap<u16, (String, String)>,
    pub channels: BTreeMap<u16, Channel>,
    /// The position behind the last record, if the file has no end.
    cut_at: Option<u64>,
    /// The places between records that cannot be read, and the spans so far.
    damage: Damage,
    /// True if it lists its channels at its end.
    pub has_summary: bool,
}

impl BagFile {
    /// Opens a file, and returns the spans of its messages.
    pub fn open(path: &Path) -> Result<(Self, Vec<TimedSpan>), BagError> {
        let file = gyre_storage::open(path).map_err(|error| BagError::io(path, error))?;
        let found = spans(path, &file)?;
        let mut bag = Self {
            path: path.to_owned(),
            file,
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            cut_at: (!found.is_complete).then_some(found.end),
            damage: found.damage,
            has_summary: false,
        };
        for span in found.summary {
            bag.read(span, |_| false)?;
        }
        // One that is damaged may lack a channel.
        bag.has_summary = !bag.channels.is_empty() && bag.damage.is_empty();
        Ok((bag, found.messages))
    }

    /// Returns a sentence about damaged or missing parts, as far as the file has been read.
    pub fn damage(&self) -> Option<String> {
        sentence(&self.path, &self.damage, self.cut_at)
    }

    /// Returns the messages of a span that are of wanted channels, and learns the channels in it.
    ///
    /// # Errors
    /// It cannot be read, or is damaged.
    pub fn read(
        &mut self,
        span: Span,
        wanted: impl Fn(&Channel) -> bool,
    ) -> Result<Vec<Message>, BagError> {
        let mut messages = Vec::new();
        let read = match crate::damaged::read(&self.file, span) {
            Ok(bytes) => self.parse(&bytes, &wanted, &mut messages),
            Err(error) if error.kind() == io::ErrorKind::FileTooLarge => {
                Err(McapError::ChunkTooLarge(span.bytes))
            }
            Err(error) => return Err(BagError::io(&self.path, error)),
        };
        if let Err(error) = read {
            self.damage.insert(span.offset);
            return Err(BagError::Damaged {
                path: self.path.clone(),
                offset: span.offset,
                reason: error.to_string(),
            });
        }
        let is_compressed = |message: &Message| message.data.starts_with(&ZSTD);
        match messages.iter().any(is_compressed) {
            true => Err(compressed(&self.path)),
            false => Ok(messages),
        }
    }

    fn parse(
        &mut self,
        bytes: &[u8],
        wanted: &impl Fn(&Channel) -> bool,
        messages: &mut Vec<Message>,
    ) -> Result<(), McapError> {
        crate::damaged::records(bytes, |record| {
            self.learn(record, wanted).map_or(0, |message| {
                let kept = size_of::<Message>() + message.data.len();
                messages.push(message);
                kept
            })
        })
    }

    /// Learns channels, and returns a message that is wanted.
    fn learn(&mut self, record: Record<'_>, wanted: &impl Fn(&Channel) -> bool) -> Option<Message> {
        match record {
            Record::Schema { header, data }
                if self.schemas.len() < MAX_CHANNELS && header.name.len() <= MAX_NAME_BYTES =>
            {
                let text = &data[..data.len().min(MAX_SCHEMA_BYTES)];
                let text = String::from_utf8_lossy(text).into_owned();
                self.schemas.insert(header.id, (header.name, text));
            }
            Record::Channel(channel)
                if self.channels.len() < MAX_CHANNELS
                    && channel.topic.len() <= MAX_NAME_BYTES
                    && !channel.topic.contains(char::is_control) =>
            {
                let schema = self.schemas.get(&channel.schema_id);
                let (type_name, schema) = schema.cloned().unwrap_or_default();
                let learned = Channel {
                    topic: channel.topic,
                    type_name,
                    schema,
                    encoding: channel.message_encoding,
                };
                self.channels.insert(channel.id, learned);
            }
            Record::Message { header, data } => {
                let channel = self.channels.get(&header.channel_id)?;
                return wanted(channel).then(|| Message {
                    channel: header.channel_id,
                    log_ns: i64::try_from(header.log_time).unwrap_or(i64::MAX),
                    data: data.into_owned(),
                });
            }
            _ => {}
        }
        None
    }
}
