//! Payloads and datagrams that do not fit their messages.

use thiserror::Error;

/// Bytes before the powers of an azimuth, at least.
pub(crate) const AZIMUTH_BYTES: usize = 14;

/// A payload that does not fit its message.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum MalformedMessage {
    #[error("the payload of {message} has {actual} bytes, expected at least {expected}")]
    Short {
        message: &'static str,
        /// Bytes required.
        expected: usize,
        /// Bytes present.
        actual: usize,
    },
    #[error(
        "the powers of an azimuth begin at byte {offset} of a payload of {payload_bytes} bytes, expected {AZIMUTH_BYTES} or more"
    )]
    DataOffset {
        /// The first byte of the powers, as stated by the message.
        offset: u16,
        /// Bytes of the payload.
        payload_bytes: usize,
    },
    #[error("an azimuth of 16-bit powers has {bytes} bytes of powers, an odd number")]
    OddBytes {
        /// Bytes of the powers.
        bytes: usize,
    },
    #[error("navigation data have {bytes} bytes of peaks, of 6 bytes each")]
    Peaks {
        /// Bytes of the peaks.
        bytes: usize,
    },
    #[error("the protobuf of {message} is malformed at byte {at}")]
    Protobuf {
        message: &'static str,
        /// The first byte of the field that cannot be parsed.
        at: usize,
    },
}

/// The category of ASTERIX: the first byte of a message.
pub(crate) const CATEGORY: u8 = 240;

/// A datagram that is no part of an azimuth.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum MalformedDatagram {
    #[error(
        "Navtech's message {id} by UDP carries no powers: set the radar's data output to CAT-240"
    )]
    Colossus { id: u8 },
    #[error("a datagram begins with {0}, expected the category {CATEGORY} of ASTERIX")]
    Category(u8),
    #[error("a message of {expected} bytes is in a datagram of {actual}")]
    Length {
        /// Bytes of the message, as stated by it.
        expected: usize,
        /// Bytes of the datagram.
        actual: usize,
    },
    #[error("a message ends within its item {0}")]
    Short(&'static str),
    #[error("a message lacks the item {0}")]
    Missing(&'static str),
    #[error(
        "a message has powers of resolution {resolution} (4: 8 bits, 5: 16 bits), compressed: {compressed}"
    )]
    Resolution {
        /// The item's number.
        resolution: u8,
        /// The powers are compressed.
        compressed: bool,
    },
    /// The cells do not fit in their blocks, or beyond the last bin.
    #[error("a message has {cells} bins from bin {first} in {bytes} bytes, of {bins} bins")]
    Cells {
        /// Bins in the message.
        cells: usize,
        /// The first bin.
        first: usize,
        /// Bytes of its cells.
        bytes: usize,
        /// Bins of an azimuth.
        bins: usize,
    },
}

/// Returns the first bytes of a payload.
pub(crate) fn head<const N: usize>(
    message: &'static str,
    payload: &[u8],
) -> Result<[u8; N], MalformedMessage> {
    payload
        .first_chunk()
        .copied()
        .ok_or(MalformedMessage::Short {
            message,
            expected: N,
            actual: payload.len(),
        })
}
