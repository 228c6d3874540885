//! Azimuths from datagrams, in any order, doubled or lost.

use std::mem;

use super::{Special, Video, decode};
use crate::configuration::Configuration;
use crate::message::{Azimuth, Message, Powers};
use crate::parser::Event;

const MAX_BYTES: usize = 1 << 16;
const MAX_PARTS: usize = 1024;
/// The largest step of the number of a message: a larger step means that the radar has restarted.
const MAX_STEP: i32 = 1 << 16;

/// A [`Parser`](crate::Parser) for datagrams. The first event is the radar's description of itself,
/// which each datagram carries.
///
/// An azimuth is returned when its last part is there, in whatever order they come. It is lost if a
/// part of another azimuth comes before that.
#[derive(Clone, Debug)]
pub struct Datagrams {
    encoder_size: u16,
    buffer: Vec<u8>,
    /// Bytes of the datagram in the buffer; 0: none.
    filled: usize,
    described: Option<Configuration>,
    newest: Option<u32>,
    open: Assembly,
    ended: Assembly,
    /// A datagram of the radar has come, with or without powers.
    has_part: bool,
}

enum Step {
    Nothing,
    Description(Configuration),
    Complete,
    /// The azimuth before this datagram's has ended; the datagram is still to be handled.
    Ended,
}

impl Datagrams {
    /// Returns a parser for a radar whose encoder has so many counts per turn: angles are rounded
    /// to them.
    pub fn new(encoder_size: u16) -> Self {
        Self {
            encoder_size,
            buffer: vec![0; MAX_BYTES],
            filled: 0,
            described: None,
            newest: None,
            open: Assembly::default(),
            ended: Assembly::default(),
            has_part: false,
        }
    }

    /// Returns memory to read a datagram into, once all events have been taken.
    pub fn space(&mut self) -> &mut [u8] {
        &mut self.buffer
    }

    pub fn filled(&mut self, bytes: usize) {
        self.filled = bytes.min(MAX_BYTES);
    }

    /// Returns the next message or fault; `None` until the next datagram is there.
    #[expect(
        clippy::should_implement_trait,
        reason = "a message borrows the parser"
    )]
    pub fn next(&mut self) -> Option<Event<'_>> {
        let bytes = mem::take(&mut self.filled);
        if bytes == 0 {
            return None;
        }
        // The buffer is not changed by what follows.
        let buffer = mem::take(&mut self.buffer);
        let step = decode(&buffer[..bytes]).map(|video| match video {
            Some(video) => self.step(&video),
            None => Step::Nothing,
        });
        self.buffer = buffer;
        match step {
            Ok(Step::Nothing) => None,
            Ok(Step::Description(configuration)) => {
                self.filled = bytes;
                Some(Event::Message(Message::Configuration(configuration)))
            }
            Ok(Step::Complete) => message(&self.open, self.encoder_size),
            Ok(Step::Ended) => {
                self.filled = bytes;
                message(&self.ended, self.encoder_size)
            }
            Err(malformed) => Some(Event::Damaged {
                reason: malformed.into(),
                skipped_bytes: bytes,
            }),
        }
    }

    /// Passes over the description that was returned last, and the datagram that it came with. The
    /// next datagram is described again, so that no datagram is attributed to a different radar.
    pub fn refuse_description(&mut self) {
        self.described = None;
        self.filled = 0;
    }

    /// Returns whether a datagram of the radar has come since the last call, whatever became of its
    /// azimuth.
    pub fn take_part(&mut self) -> bool {
        mem::take(&mut self.has_part)
    }

    fn step(&mut self, video: &Video<'_>) -> Step {
        let configuration = video.configuration(self.encoder_size);
        if self.described != Some(configuration) {
            self.described = Some(configuration);
            return Step::Description(configuration);
        }
        self.has_part = true;
        let ahead = |newest: u32| video.number.wrapping_sub(newest) as i32;
        let ahead = self.newest.map_or(1, ahead);
        let is_late = (-MAX_STEP..=0).contains(&ahead);
        if !video.powers.is_empty() && !self.open.is_of(video) {
            if is_late {
                // Its azimuth was complete, or lost.
                return Step::Nothing;
            }
            if self.open.ends_before(video.number) {
                mem::swap(&mut self.open, &mut self.ended);
                self.open.clear();
                return Step::Ended;
            }
            self.open.begin(video);
        }
        if !is_late {
            self.newest = Some(video.number);
        }
        match !video.powers.is_empty() && self.open.add(video) {
            true => Step::Complete,
            false => Step::Nothing,
        }
    }
}

fn message(azimuth: &Assembly, encoder_size: u16) -> Option<Event<'_>> {
    let azimuth = azimuth.azimuth(encoder_size)?;
    Some(Event::Message(Message::Azimuth(azimuth)))
}

/// An azimuth from the messages that carry its parts.
#[derive(Clone, Debug, Default)]
struct Assembly {
    /// Angle and description, the same in all parts; `None` before the first.
    of: Option<(u16, Special)>,
    bin_bytes: usize,
    powers: Vec<u8>,
    parts: Vec<(usize, usize)>,
    bytes: usize,
    numbers: (u32, u32),
    /// It has been returned; further parts are duplicates.
    is_done: bool,
}

impl Assembly {
    fn is_of(&self, video: &Video<'_>) -> bool {
        self.of == Some((video.angle, video.special)) && self.bin_bytes == video.bin_bytes
    }

    fn begin(&mut self, video: &Video<'_>) {
        self.of = Some((video.angle, video.special));
        self.bin_bytes = video.bin_bytes;
        self.powers.clear();
        self.powers
            .resize(usize::from(video.special.bins) * video.bin_bytes, 0);
        self.parts.clear();
        self.bytes = 0;
        self.numbers = (video.number, video.number);
        self.is_done = false;
    }

    /// Adds a part of this azimuth, unless it is there already; true if all are there with it.
    fn add(&mut self, video: &Video<'_>) -> bool {
        let from = video.first * self.bin_bytes;
        let to = from + video.powers.len();
        let is_there = self.parts.iter().any(|part| from < part.1 && part.0 < to);
        if self.is_done || is_there || self.parts.len() == MAX_PARTS {
            return false;
        }
        // Decoding has made sure that it ends before the last bin.
        self.powers[from..to].copy_from_slice(video.powers);
        self.parts.push((from, to));
        self.bytes += to - from;
        if video.number.wrapping_sub(self.numbers.1) as i32 > 0 {
            self.numbers.1 = video.number;
        }
        self.is_done = self.bytes == self.powers.len();
        self.is_done
    }

    fn clear(&mut self) {
        self.of = None;
    }

    /// Ends an azimuth with fewer bins than stated: true if its parts follow each other from the
    /// first bin on, and no message is missing before the message with this number.
    fn ends_before(&mut self, number: u32) -> bool {
        let (first, last) = self.numbers;
        let span = last.wrapping_sub(first) as usize + 1;
        let end = self.parts.iter().map(|part| part.1).max();
        let is_whole = self.of.is_some()
            && !self.is_done
            && number == last.wrapping_add(1)
            && span == self.parts.len()
            && end == Some(self.bytes);
        if is_whole {
            self.powers.truncate(self.bytes);
            self.is_done = true;
        }
        is_whole
    }

    fn azimuth(&self, encoder_size: u16) -> Option<Azimuth<'_>> {
        let (angle, special) = self.of?;
        Some(Azimuth {
            sweep_counter: self.numbers.0 as u16,
            encoder: super::encoder(angle, encoder_size),
            seconds: special.seconds,
            split_seconds: special.nanoseconds,
            powers: match self.bin_bytes {
                2 => Powers::Sixteen(&self.powers),
                _ => Powers::Eight(&self.powers),
            },
        })
    }
}

#[cfg(test)]
#[path = "tests.rs"]
mod tests;
