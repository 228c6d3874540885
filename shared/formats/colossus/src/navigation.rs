//! Peaks that the radar itself has found in an azimuth: its navigation mode. Neither speed nor
//! position are in it.

use crate::malformed::{MalformedMessage, head};

/// Azimuth, seconds, split seconds.
const HEAD_BYTES: usize = 10;
const PEAK_BYTES: usize = 6;

/// The peaks of one azimuth: id 123. All its numbers are big-endian, unlike the time of an
/// [`Azimuth`](crate::Azimuth).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Navigation<'a> {
    /// Encoder count of the antenna, clockwise from straight ahead.
    pub encoder: u16,
    /// Seconds of the radar's clock.
    pub seconds: u32,
    /// Nanoseconds or microseconds of the second: not documented.
    pub split_seconds: u32,
    peaks: &'a [[u8; PEAK_BYTES]],
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Peak {
    /// Range, m, in steps of a micrometre.
    pub range_m: f64,
    /// Power, dB, in steps of a tenth.
    pub power_db: f32,
}

impl Navigation<'_> {
    /// Returns the peaks, as sent.
    pub fn peaks(&self) -> impl ExactSizeIterator<Item = Peak> + '_ {
        self.peaks.iter().map(|&[r0, r1, r2, r3, p0, p1]| Peak {
            range_m: f64::from(u32::from_be_bytes([r0, r1, r2, r3])) / 1e6,
            power_db: f32::from(u16::from_be_bytes([p0, p1])) / 10.0,
        })
    }
}

/// Decodes the payload of navigation data.
pub(crate) fn decode(payload: &[u8]) -> Result<Navigation<'_>, MalformedMessage> {
    let head: [u8; HEAD_BYTES] = head("navigation data", payload)?;
    let [e0, e1, s0, s1, s2, s3, p0, p1, p2, p3] = head;
    let (peaks, rest) = payload[HEAD_BYTES..].as_chunks();
    if !rest.is_empty() {
        let bytes = payload.len() - HEAD_BYTES;
        return Err(MalformedMessage::Peaks { bytes });
    }
    Ok(Navigation {
        encoder: u16::from_be_bytes([e0, e1]),
        seconds: u32::from_be_bytes([s0, s1, s2, s3]),
        split_seconds: u32::from_be_bytes([p0, p1, p2, p3]),
        peaks,
    })
}
