//! Messages from a stream of bytes that arrives in arbitrary pieces.

use thiserror::Error;

use crate::malformed::Malformed;
use crate::message::{HEADER_BYTES, MAX_PAYLOAD_BYTES, Message, SIGNATURE, VERSION, decode};

/// The most bytes that [`Parser::space`] promises.
pub const MAX_SPACE_BYTES: usize = 1 << 16;
/// The most memory of a parser: the largest message, all but a byte of it received, the end of the
/// one before, and space for more.
pub const MAX_BUFFER_BYTES: usize =
    SIGNATURE.len() + HEADER_BYTES + MAX_PAYLOAD_BYTES + MAX_SPACE_BYTES;

#[derive(Clone, Debug, PartialEq)]
pub enum Event<'a> {
    Message(Message<'a>),
    /// Bytes that are no message; they are skipped.
    Damaged {
        reason: Damage,
        skipped_bytes: usize,
    },
}

#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum Damage {
    #[error("the bytes do not start with Colossus' signature")]
    Signature,
    #[error("a message has version {0} of the protocol, expected {VERSION}")]
    Version(u8),
    #[error("a message has a payload of {0} bytes, more than {MAX_PAYLOAD_BYTES}")]
    PayloadSize(u32),
    #[error("a message is cut short: another one starts within its payload")]
    CutShort,
    #[error(transparent)]
    Malformed(#[from] Malformed),
}

/// A buffer that is filled from a socket, and the messages in it.
///
/// Read into [`Parser::space`], pass the number of bytes to [`Parser::filled`], and take all events
/// with [`Parser::next`].
///
/// After a fault all whole messages behind the next signature are found. A message that is cut
/// short may be returned with bytes of the next one, and delays what follows until as many have
/// arrived.
#[derive(Debug, Default)]
pub struct Parser {
    buffer: Vec<u8>,
    /// Received and not yet parsed: `buffer[start..end]`.
    start: usize,
    end: usize,
    /// Bytes before `start`, from the last message, that may begin a signature: that message was
    /// cut short then.
    before: usize,
    /// The first fault of the bytes that are being skipped.
    damage: Option<Damage>,
    skipped_bytes: usize,
}

impl Parser {
    pub fn new() -> Self {
        Self::default()
    }

    /// Returns memory to read into, of `at_least` bytes (at least 1, at most [`MAX_SPACE_BYTES`]),
    /// once all events have been taken. It is shorter, perhaps empty, if they have not: the buffer
    /// never has more than [`MAX_BUFFER_BYTES`].
    pub fn space(&mut self, at_least: usize) -> &mut [u8] {
        let at_least = at_least.clamp(1, MAX_SPACE_BYTES);
        if self.buffer.len() - self.end < at_least {
            let kept = self.start - self.before;
            self.buffer.copy_within(kept..self.end, 0);
            (self.start, self.end) = (self.before, self.end - kept);
            let needed = self.end + at_least;
            if needed > self.buffer.len() {
                let length = needed.next_power_of_two().min(MAX_BUFFER_BYTES);
                self.buffer
                    .reserve_exact(length.saturating_sub(self.buffer.len()));
                self.buffer.resize(length, 0);
            }
        }
        &mut self.buffer[self.end..]
    }

    /// Adds the first `bytes` of the space, which have been written to it.
    pub fn filled(&mut self, bytes: usize) {
        self.end = self.end.saturating_add(bytes).min(self.buffer.len());
    }

    /// Returns the next message or fault; `None` until more bytes are there.
    #[expect(
        clippy::should_implement_trait,
        reason = "a message borrows the parser"
    )]
    pub fn next(&mut self) -> Option<Event<'_>> {
        let (id, payload) = loop {
            match self.head() {
                Ok(None) => return None,
                Ok(Some((id, payload_bytes))) => {
                    self.before = 0;
                    if let Some(reason) = self.damage.take() {
                        let skipped_bytes = std::mem::take(&mut self.skipped_bytes);
                        return Some(Event::Damaged {
                            reason,
                            skipped_bytes,
                        });
                    }
                    let payload = self.start + HEADER_BYTES;
                    let after = payload + payload_bytes;
                    if after > self.end {
                        return None;
                    }
                    if find(&self.buffer[self.start + 1..after]).is_none() {
                        break (id, payload..after);
                    }
                    self.skip(Damage::CutShort);
                }
                Err(damage) => self.skip(damage),
            }
        };
        let skipped_bytes = payload.end - self.start;
        self.before = begun(&self.buffer[self.start + 1..payload.end]);
        self.start = payload.end;
        Some(match decode(id, &self.buffer[payload]) {
            Ok(message) => Event::Message(message),
            Err(malformed) => Event::Damaged {
                reason: malformed.into(),
                skipped_bytes,
            },
        })
    }

    /// Returns the number of bytes that have been skipped since the last event: it grows while the
    /// stream is not Colossus.
    pub fn skipped_bytes(&self) -> usize {
        self.skipped_bytes
    }

    /// Returns id and payload size of the message at the start; `None` until its header is there.
    fn head(&self) -> Result<Option<(u8, usize)>, Damage> {
        let pending = &self.buffer[self.start..self.end];
        if self.before > 0 && !pending.is_empty() && agree(pending, &SIGNATURE[self.before..]) {
            // The signature has begun in the last message.
            return match self.before + pending.len() >= SIGNATURE.len() {
                true => Err(Damage::CutShort),
                false => Ok(None),
            };
        }
        if !agree(pending, &SIGNATURE) {
            return Err(Damage::Signature);
        }
        let Some(&[version, id, s0, s1, s2, s3]) =
            pending.get(SIGNATURE.len()..).and_then(<[u8]>::first_chunk)
        else {
            return Ok(None);
        };
        let payload_bytes = u32::from_be_bytes([s0, s1, s2, s3]);
        if version != VERSION {
            return Err(Damage::Version(version));
        }
        if payload_bytes as usize > MAX_PAYLOAD_BYTES {
            return Err(Damage::PayloadSize(payload_bytes));
        }
        Ok(Some((id, payload_bytes as usize)))
    }

    /// Moves to the next signature, or to its first bytes at the end.
    fn skip(&mut self, damage: Damage) {
        let before = std::mem::take(&mut self.before);
        let is_back = before > 0 && damage == Damage::CutShort;
        self.damage.get_or_insert(damage);
        if is_back {
            self.start -= before;
            return;
        }
        // There is at least one byte, which is no signature's first.
        let pending = &self.buffer[self.start + 1..self.end];
        let skipped = 1 + find(pending).unwrap_or(pending.len() - begun(pending));
        self.start += skipped;
        self.skipped_bytes = self.skipped_bytes.saturating_add(skipped);
    }
}

/// Returns whether bytes are equal as far as both go.
fn agree(one: &[u8], other: &[u8]) -> bool {
    one.iter().zip(other).all(|(a, b)| a == b)
}

/// Returns the number of bytes at the end that begin a signature. There is one at most, as its
/// first byte does not repeat.
fn begun(bytes: &[u8]) -> usize {
    let most = bytes.len().min(SIGNATURE.len() - 1);
    let begun = (1..=most).find(|n| bytes.ends_with(&SIGNATURE[..*n]));
    begun.unwrap_or(0)
}

/// Returns the place of the first signature (Horspool's search: most bytes of powers are not looked
/// at).
fn find(bytes: &[u8]) -> Option<usize> {
    let mut at = 0;
    while let Some(window) = bytes.get(at..at + SIGNATURE.len()) {
        if window == SIGNATURE {
            return Some(at);
        }
        let (last, before) = (
            window[SIGNATURE.len() - 1],
            &SIGNATURE[..SIGNATURE.len() - 1],
        );
        let place = before.iter().rposition(|byte| *byte == last);
        at += place.map_or(SIGNATURE.len(), |place| before.len() - place);
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_signature_is_found_at_any_place(
            mut bytes in prop::collection::vec(prop::sample::select(SIGNATURE.to_vec()), 0..80),
            at in 0_usize..80,
        ) {
            let naive = |bytes: &[u8]| bytes.windows(16).position(|window| window == SIGNATURE);
            prop_assert_eq!(find(&bytes), naive(&bytes));
            let at = at.min(bytes.len());
            bytes.splice(at..at, SIGNATURE);
            prop_assert_eq!(find(&bytes), naive(&bytes));
        }
    }

    #[test]
    fn a_buffer_that_is_never_emptied_stays_bounded() {
        let mut parser = Parser::new();
        while let n @ 1.. = parser.space(4096).len() {
            parser.filled(n);
        }
        assert_eq!(parser.buffer.capacity(), MAX_BUFFER_BYTES);
        parser.filled(usize::MAX);
        assert_eq!(parser.next(), None);
        assert_eq!(parser.skipped_bytes(), MAX_BUFFER_BYTES - 1);
    }
}
