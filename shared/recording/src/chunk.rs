//! The messages of a chunk.

use std::{
    collections::BTreeMap,
    fs::File,
    io::{Read, Seek, SeekFrom},
    path::Path,
};

use mcap::{
    McapError,
    records::{MessageHeader, Record},
    sans_io::linear_reader::{LinearReadEvent, LinearReader, LinearReaderOptions},
};

use crate::{RecordingError, walk::Span};

/// The largest record that is read, bytes: ten times the largest scan.
const MAX_RECORD_BYTES: usize = 256 << 20;

/// The channels of a file: the name of each by its number.
pub(crate) type Channels = BTreeMap<u16, String>;

/// A message in a chunk.
#[derive(Debug)]
pub(crate) struct Message {
    pub channel: u16,
    pub sequence: u32,
    pub data: Vec<u8>,
}

/// Reads a chunk, and adds the channels in it to those that are known.
///
/// # Errors
/// It cannot be read, or is damaged.
pub(crate) fn read(
    path: &Path,
    mut file: &File,
    span: Span,
    channels: &mut Channels,
) -> Result<Vec<Message>, RecordingError> {
    let failed = |source| RecordingError::Io {
        path: path.to_owned(),
        source,
    };
    let mut bytes = Vec::new();
    file.seek(SeekFrom::Start(span.offset)).map_err(failed)?;
    file.take(span.bytes)
        .read_to_end(&mut bytes)
        .map_err(failed)?;
    messages(&bytes, channels).map_err(|error| RecordingError::Damaged {
        path: path.to_owned(),
        offset: span.offset,
        reason: error.to_string(),
    })
}

/// Returns the messages in the record of a chunk.
fn messages(mut bytes: &[u8], channels: &mut Channels) -> Result<Vec<Message>, McapError> {
    let options = LinearReaderOptions::default()
        .with_skip_start_magic(true)
        .with_skip_end_magic(true)
        .with_validate_chunk_crcs(true)
        .with_record_length_limit(MAX_RECORD_BYTES);
    let mut reader = LinearReader::new_with_options(options);
    let mut messages = Vec::new();
    while let Some(event) = reader.next_event() {
        match event? {
            LinearReadEvent::ReadRequest(_) if bytes.is_empty() => break,
            LinearReadEvent::ReadRequest(bytes_wanted) => {
                let (now, later) = bytes.split_at(bytes_wanted.min(bytes.len()));
                reader.insert(now.len()).copy_from_slice(now);
                reader.notify_read(now.len());
                bytes = later;
            }
            LinearReadEvent::Record { data, opcode } => match mcap::parse_record(opcode, data)? {
                Record::Channel(channel) => {
                    channels.insert(channel.id, channel.topic);
                }
                Record::Message { header, data } => messages.push(message(&header, &data)),
                _ => {}
            },
        }
    }
    Ok(messages)
}

fn message(header: &MessageHeader, data: &[u8]) -> Message {
    Message {
        channel: header.channel_id,
        sequence: header.sequence,
        data: data.to_vec(),
    }
}
