//! The places of messages in a file: its chunks, and the records outside of chunks.

use mcap::records::op;

use crate::{
    RecordingError,
    file::{McapFile, Span, Times, joined},
};

/// Records outside of chunks form a span of their own from this size on, bytes.
const PLAIN_BYTES: u64 = 4 << 20;

/// The spans of a file: chunks, or records that are read together.
#[derive(Debug, Default, PartialEq, Eq)]
pub(crate) struct Spans {
    pub messages: Vec<TimedSpan>,
    /// Those with the names of all channels, at the end of the file.
    pub summary: Vec<Span>,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TimedSpan {
    pub span: Span,
    /// The receive times of its first and last message.
    pub times_ns: Times,
}

pub(crate) fn spans(file: &mut McapFile) -> Result<Spans, RecordingError> {
    let mut found = Spans::default();
    // Records outside of chunks.
    let mut plain: Option<TimedSpan> = None;
    while let Some((opcode, span)) = file.next_record()? {
        let times_ns = file.times_ns(opcode, span)?;
        match opcode {
            op::SCHEMA | op::CHANNEL if file.is_complete => found.summary.push(span),
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
        if opcode == op::CHUNK {
            found.messages.push(TimedSpan { span, times_ns });
        }
    }
    found.messages.extend(plain);
    Ok(found)
}
