//! The messages of a span.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{Read, Seek, SeekFrom},
    path::{Path, PathBuf},
};

use mcap::{
    McapError,
    records::Record,
    sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions},
};

use crate::{
    BagError,
    spans::{Span, spans},
};

/// The largest record that is read, bytes: several times the largest scan.
const MAX_RECORD_BYTES: usize = 64 << 20;
/// The largest span that is read, bytes, of messages that are wanted.
const MAX_KEPT_BYTES: usize = 256 << 20;
/// The largest span, bytes in the file. ROS 2's chunks have 768 kB.
const MAX_SPAN_BYTES: u64 = 256 << 20;

/// The largest number of channels and of schemas of a file, the longest name of a topic, and what is kept of a schema, bytes.
const MAX_CHANNELS: usize = 4096;
const MAX_NAME_BYTES: usize = 1024;
const MAX_SCHEMA_BYTES: usize = 4096;

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
    /// Whether its writer came to its end.
    pub is_complete: bool,
    /// Whether it lists its channels at its end.
    pub has_summary: bool,
}

impl BagFile {
    /// Opens a file, and returns the spans of its messages.
    pub fn open(path: &Path, number: u32) -> Result<(Self, Vec<Span>), BagError> {
        let file = File::open(path).map_err(|error| BagError::io(path, error))?;
        let found = spans(path, &file, number)?;
        let mut bag = Self {
            path: path.to_owned(),
            file,
            schemas: BTreeMap::new(),
            channels: BTreeMap::new(),
            is_complete: found.is_complete,
            has_summary: false,
        };
        for span in found.summary {
            bag.read(span, |_| false)?;
        }
        bag.has_summary = !bag.channels.is_empty();
        Ok((bag, found.messages))
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
        let read = match span.bytes <= MAX_SPAN_BYTES {
            true => {
                let bytes = self.bytes(span).map_err(|e| BagError::io(&self.path, e))?;
                self.parse(&bytes, &wanted, &mut messages)
            }
            false => Err(McapError::ChunkTooLarge(span.bytes)),
        };
        read.map_err(|error| BagError::Damaged {
            path: self.path.clone(),
            offset: span.offset,
            reason: error.to_string(),
        })?;
        Ok(messages)
    }

    fn bytes(&self, span: Span) -> std::io::Result<Vec<u8>> {
        let mut file = &self.file;
        file.seek(SeekFrom::Start(span.offset))?;
        let mut bytes = Vec::new();
        file.take(span.bytes).read_to_end(&mut bytes)?;
        Ok(bytes)
    }

    fn parse(
        &mut self,
        mut bytes: &[u8],
        wanted: &impl Fn(&Channel) -> bool,
        messages: &mut Vec<Message>,
    ) -> Result<(), McapError> {
        let options = LinearReaderOptions::default()
            .with_skip_start_magic(true)
            .with_skip_end_magic(true)
            .with_validate_chunk_crcs(true)
            .with_record_length_limit(MAX_RECORD_BYTES);
        let mut reader = LinearReader::new_with_options(options);
        let mut kept = 0;
        while let Some(event) = reader.next_event() {
            match event? {
                LinearReadEvent::ReadRequest(_) if bytes.is_empty() => break,
                LinearReadEvent::ReadRequest(bytes_wanted) => {
                    let (now, later) = bytes.split_at(bytes_wanted.min(bytes.len()));
                    reader.insert(now.len()).copy_from_slice(now);
                    reader.notify_read(now.len());
                    bytes = later;
                }
                LinearReadEvent::Record { data, opcode } => {
                    let record = mcap::parse_record(opcode, data)?;
                    let Some(message) = self.learn(record, wanted) else {
                        continue;
                    };
                    kept += message.data.len();
                    if kept > MAX_KEPT_BYTES {
                        return Err(McapError::ChunkTooLarge(kept as u64));
                    }
                    messages.push(message);
                }
            }
        }
        Ok(())
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
                if self.channels.len() < MAX_CHANNELS && channel.topic.len() <= MAX_NAME_BYTES =>
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
