//! An azimuth from the messages that carry its parts.

use super::{Special, Video};
use crate::message::{Azimuth, Powers};

const MAX_PARTS: usize = 1024;

#[derive(Clone, Debug, Default)]
pub(super) struct Assembly {
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
    pub(super) fn is_of(&self, video: &Video<'_>) -> bool {
        self.of == Some((video.angle, video.special)) && self.bin_bytes == video.bin_bytes
    }

    pub(super) fn begin(&mut self, video: &Video<'_>) {
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
    pub(super) fn add(&mut self, video: &Video<'_>) -> bool {
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

    pub(super) fn clear(&mut self) {
        self.of = None;
    }

    /// Ends an azimuth with fewer bins than stated: true if its parts follow each other from the
    /// first bin on, and no message is missing before the message with this number.
    pub(super) fn ends_before(&mut self, number: u32) -> bool {
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

    pub(super) fn azimuth(&self, encoder_size: u16) -> Option<Azimuth<'_>> {
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
