//! Messages as bytes: CDR, after four bytes that state the byte order.

use byteorder::{BigEndian, LittleEndian};
use thiserror::Error;

use crate::Ros2Message;

/// Plain CDR, little-endian, without options.
const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];
/// Bytes before the message.
const HEAD_BYTES: usize = LITTLE_ENDIAN.len();

/// Bytes that are not a message of a type.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum BadMessage {
    #[error(
        "{type_name}: {found:02x?} does not begin a message in CDR, expected [00, 00] or [00, 01]"
    )]
    Encoding {
        type_name: String,
        /// The first bytes, at most four.
        found: Vec<u8>,
    },
    #[error("{type_name}: {reason} in a message of {bytes} bytes")]
    Content {
        type_name: String,
        /// The bytes of the message.
        bytes: usize,
        reason: String,
    },
    #[error("{type_name}: {reason}")]
    Field { type_name: String, reason: String },
}

/// Returns a message as little-endian CDR, as `rosbag2` stores it and DDS sends it.
pub fn encode<T: Ros2Message>(message: &T) -> Result<Vec<u8>, BadMessage> {
    let mut bytes = LITTLE_ENDIAN.to_vec();
    cdr_encoding::to_writer::<_, LittleEndian, _>(&mut bytes, message)
        .map_err(|error| bad_content::<T>(0, &error))?;
    Ok(bytes)
}

/// Returns the message in these bytes. What follows it is padding. It allocates no more than the
/// bytes hold, whatever lengths they give.
pub fn decode<T: Ros2Message>(bytes: &[u8]) -> Result<T, BadMessage> {
    let (head, content) = bytes
        .split_at_checked(HEAD_BYTES)
        .ok_or_else(|| bad_encoding::<T>(bytes))?;
    let decoded = match head {
        [0, 0, ..] => cdr_encoding::from_bytes::<T, BigEndian>(content),
        [0, 1, ..] => cdr_encoding::from_bytes::<T, LittleEndian>(content),
        _ => return Err(bad_encoding::<T>(head)),
    };
    let (message, _) = decoded.map_err(|error| bad_content::<T>(bytes.len(), &error))?;
    Ok(message)
}

fn bad_encoding<T: Ros2Message>(head: &[u8]) -> BadMessage {
    BadMessage::Encoding {
        type_name: T::DEFINITION.type_name(),
        found: head.to_vec(),
    }
}

fn bad_content<T: Ros2Message>(bytes: usize, error: &cdr_encoding::Error) -> BadMessage {
    BadMessage::Content {
        type_name: T::DEFINITION.type_name(),
        bytes,
        reason: error.to_string(),
    }
}
