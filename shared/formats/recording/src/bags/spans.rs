//! The places of messages in a file: its chunks, and the records outside of chunks.

use mcap::records::op;

use crate::{
    RecordingError,
    file::{McapFile, Span, Times, joined},
};

/// Records outside of chunks form a span of their own from this size on, bytes.
const PLAIN_BYTES: u64 = 4 << 20;

/// A chunk with messages, or records that are read together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct TimedSpan {
    pub span: Span,
    /// The receive times of its first and last message.
    pub times_ns: Times,
}

/// Finds the spans of a file with messages, and learns its channels from the summary at its end.
pub(crate) fn spans(file: &mut McapFile) -> Result<Vec<TimedSpan>, RecordingError> {
    let mut found = Vec::new();
    // Records outside of chunks.
    let mut plain: Option<TimedSpan> = None;
    while let Some((opcode, span)) = file.next_record()? {
        let times_ns = file.times_ns(opcode, span)?;
        match opcode {
            op::SCHEMA | op::CHANNEL if file.is_complete => {
                file.read(span, |_| false)?;
            }
            op::SCHEMA | op::CHANNEL | op::MESSAGE => {
                // A damaged place parts them.
                let ends_there = |plain: &mut TimedSpan| plain.span.end() != span.offset;
                found.extend(plain.take_if(ends_there));
                let plain = plain.get_or_insert(TimedSpan {
                    span: Span { bytes: 0, ..span },
                    times_ns,
                });
                plain.span.bytes += span.bytes;
                plain.times_ns = joined(plain.times_ns, times_ns);
            }
            _ => found.extend(plain.take()),
        }
        let is_long = |plain: &mut TimedSpan| plain.span.bytes >= PLAIN_BYTES;
        found.extend(plain.take_if(is_long));
        if opcode == op::CHUNK {
            found.push(TimedSpan { span, times_ns });
        }
    }
    found.extend(plain);
    Ok(found)
}
