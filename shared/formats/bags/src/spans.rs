//! The places of messages in a file: its chunks, and the records outside of chunks.

use std::{fs::File, io, ops::Range, path::Path};

use crate::damaged::{Span, Walk};
use mcap::records::op;

use crate::BagError;

/// The size from which on records outside of chunks are a span of their own, bytes.
const PLAIN_BYTES: u64 = 4 << 20;

/// The spans of a file: chunks, or records that are read together.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Spans {
    /// Those with messages.
    pub messages: Vec<Span>,
    /// Those with the names of all channels, at the end of the file.
    pub summary: Vec<Span>,
    /// True if the file goes on to its end.
    pub is_complete: bool,
    /// The first and last time at which a message was received, ns; `None` without messages.
    pub times_ns: Option<(u64, u64)>,
}

/// The place of its times in a chunk, and of its time in a message, behind opcode and length.
const CHUNK_TIMES: Range<usize> = 9..25;
const MESSAGE_TIME: Range<usize> = 15..23;

impl Spans {
    /// Adds the times that are in a record.
    fn add_times(&mut self, file: &File, opcode: u8, span: Span) -> io::Result<()> {
        let place = match opcode {
            op::CHUNK => CHUNK_TIMES,
            op::MESSAGE => MESSAGE_TIME,
            _ => return Ok(()),
        };
        let bytes = span.bytes.min(place.end as u64);
        let head = crate::damaged::read(file, Span { bytes, ..span })?;
        let (numbers, _) = head.get(place).unwrap_or_default().as_chunks::<8>();
        // A chunk without messages has zeros.
        let times = numbers.iter().map(|bytes| u64::from_le_bytes(*bytes));
        for time in times.filter(|time| *time > 0) {
            let (first, last) = self.times_ns.unwrap_or((time, time));
            self.times_ns = Some((first.min(time), last.max(time)));
        }
        Ok(())
    }
}

/// Finds the spans of a file.
pub(crate) fn spans(path: &Path, file: &File) -> Result<Spans, BagError> {
    let failed = |error| BagError::io(path, error);
    let Some(mut walk) = Walk::new(file).map_err(failed)? else {
        let reason =
            "does not begin with the signature of MCAP: it is no bag, or was not copied whole";
        return Err(BagError::unreadable(path, reason));
    };
    let mut found = Spans::default();
    // Records outside of chunks.
    let mut plain: Option<Span> = None;
    while let Some((opcode, span)) = walk.next().map_err(failed)? {
        found.add_times(file, opcode, span).map_err(failed)?;
        match opcode {
            op::SCHEMA | op::CHANNEL if found.is_complete => found.summary.push(span),
            op::SCHEMA | op::CHANNEL | op::MESSAGE => {
                let plain = plain.get_or_insert(Span { bytes: 0, ..span });
                plain.bytes += span.bytes;
            }
            _ => found.messages.extend(plain.take()),
        }
        found
            .messages
            .extend(plain.take_if(|plain| plain.bytes >= PLAIN_BYTES));
        match opcode {
            op::CHUNK => found.messages.push(span),
            op::DATA_END | op::FOOTER => found.is_complete = true,
            _ => {}
        }
    }
    found.messages.extend(plain);
    Ok(found)
}
