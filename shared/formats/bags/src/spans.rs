//! The places of messages in a file: its chunks, and the records outside of chunks.

use std::{fs::File, io, ops::Range, path::Path};

use crate::damaged::{Damage, Span, Walk};
use mcap::records::op;

use crate::BagError;

/// The size from which on records outside of chunks are a span of their own, bytes.
const PLAIN_BYTES: u64 = 4 << 20;

/// The spans of a file: chunks, or records that are read together.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Spans {
    /// Those with messages.
    pub messages: Vec<TimedSpan>,
    /// Those with the names of all channels, at the end of the file.
    pub summary: Vec<Span>,
    /// True if the file has its end.
    pub is_complete: bool,
    /// The position behind the last record.
    pub end: u64,
    /// The places that cannot be read.
    pub damage: Damage,
}

/// A span with messages.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TimedSpan {
    pub span: Span,
    /// The first and last time at which a message in it was received, ns; `None` without messages.
    pub times_ns: Times,
}

/// A first and last time, ns since 1970.
pub(crate) type Times = Option<(u64, u64)>;

/// Returns the times of both.
pub(crate) fn joined(times: Times, others: Times) -> Times {
    match (times, others) {
        (Some((first, last)), Some(other)) => Some((first.min(other.0), last.max(other.1))),
        (times, others) => times.or(others),
    }
}

/// The place of its times in a chunk, and of its time in a message, behind opcode and length.
const CHUNK_TIMES: Range<usize> = 9..25;
const MESSAGE_TIME: Range<usize> = 15..23;

/// Returns the times that are in a record.
fn times_ns(file: &File, opcode: u8, span: Span) -> io::Result<Times> {
    let place = match opcode {
        op::CHUNK => CHUNK_TIMES,
        op::MESSAGE => MESSAGE_TIME,
        _ => return Ok(None),
    };
    let bytes = span.bytes.min(place.end as u64);
    let head = crate::damaged::read(file, Span { bytes, ..span })?;
    let (numbers, _) = head.get(place).unwrap_or_default().as_chunks::<8>();
    // A chunk without messages has zeros.
    let times = numbers.iter().map(|bytes| u64::from_le_bytes(*bytes));
    let times = times
        .filter(|time| *time > 0)
        .map(|time| Some((time, time)));
    Ok(times.fold(None, joined))
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
    let mut plain: Option<TimedSpan> = None;
    while let Some((opcode, span)) = walk.next().map_err(failed)? {
        let times_ns = times_ns(file, opcode, span).map_err(failed)?;
        match opcode {
            op::SCHEMA | op::CHANNEL if found.is_complete => found.summary.push(span),
            op::SCHEMA | op::CHANNEL | op::MESSAGE => {
                // A damaged place parts them.
                let ends_there = |plain: &mut TimedSpan| plain.span.end() != span.offset;
                found.messages.extend(plain.take_if(ends_there));
                let plain = plain.get_or_insert(TimedSpan {
                    span: Span { bytes: 0, ..span },
                    times_ns,
                });
                plain.span.bytes += span.bytes;
                plain.times_ns = joined(plain.times_ns, times_ns);
            }
            _ => found.messages.extend(plain.take()),
        }
        let is_long = |plain: &mut TimedSpan| plain.span.bytes >= PLAIN_BYTES;
        found.messages.extend(plain.take_if(is_long));
        match opcode {
            op::CHUNK => found.messages.push(TimedSpan { span, times_ns }),
            op::DATA_END | op::FOOTER => found.is_complete = true,
            _ => {}
        }
    }
    found.messages.extend(plain);
    (found.end, found.damage) = (walk.offset, walk.damage);
    Ok(found)
}
