//! Payloads that do not fit their messages.

use thiserror::Error;

/// Bytes before the powers of an azimuth, at least.
pub(crate) const AZIMUTH_BYTES: usize = 14;

/// A payload that does not fit its message.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum MalformedMessage {
    /// The payload is too short.
    #[error("the payload of {message} has {actual} bytes, expected at least {expected}")]
    Short {
        /// The kind of message.
        message: &'static str,
        /// Bytes required.
        expected: usize,
        /// Bytes present.
        actual: usize,
    },
    /// The powers begin outside of the payload.
    #[error(
        "the powers of an azimuth begin at byte {offset} of a payload of {payload_bytes} bytes, expected {AZIMUTH_BYTES} or more"
    )]
    DataOffset {
        /// The first byte of the powers, as the message says.
        offset: u16,
        /// Bytes of the payload.
        payload_bytes: usize,
    },
    /// Powers of 16 bits with half a power at the end.
    #[error("an azimuth of 16-bit powers has {bytes} bytes of powers, an odd number")]
    OddBytes {
        /// Bytes of the powers.
        bytes: usize,
    },
    /// Navigation data with a part of a peak at the end.
    #[error("navigation data have {bytes} bytes of peaks, of 6 bytes each")]
    Peaks {
        /// Bytes of the peaks.
        bytes: usize,
    },
    /// The protobuf of a message cannot be parsed.
    #[error("the protobuf of {message} is malformed at byte {at}")]
    Protobuf {
        /// The kind of message.
        message: &'static str,
        /// The first byte of the field that cannot be parsed.
        at: usize,
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
