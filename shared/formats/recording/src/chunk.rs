//! The messages of a chunk.

use std::{collections::BTreeMap, fs::File, path::Path};

use gyre_bags::damaged::Span;
use mcap::records::{MessageHeader, Record};

use crate::RecordingError;

/// The longest name of a channel, bytes.
const MAX_NAME_BYTES: usize = 1024;

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
    file: &File,
    span: Span,
    channels: &mut Channels,
) -> Result<Vec<Message>, RecordingError> {
    let bytes = gyre_bags::damaged::read(file, span).map_err(|source| RecordingError::Io {
        path: path.to_owned(),
        source,
    })?;
    let mut messages = Vec::new();
    let read = gyre_bags::damaged::records(&bytes, |record| match record {
        // None of Gyre's is longer.
        Record::Channel(channel) if channel.topic.len() <= MAX_NAME_BYTES => {
            channels.insert(channel.id, channel.topic);
            0
        }
        Record::Message { header, data } => {
            messages.push(message(&header, &data));
            size_of::<Message>() + data.len()
        }
        _ => 0,
    });
    match read {
        Ok(()) => Ok(messages),
        Err(error) => Err(RecordingError::Damaged {
            path: path.to_owned(),
            offset: span.offset,
            reason: error.to_string(),
        }),
    }
}

fn message(header: &MessageHeader, data: &[u8]) -> Message {
    Message {
        channel: header.channel_id,
        sequence: header.sequence,
        data: data.to_vec(),
    }
}
