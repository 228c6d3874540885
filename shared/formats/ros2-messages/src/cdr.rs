//! Messages as bytes: CDR, after four bytes that state the byte order.

use std::fmt::Display;

use byteorder::{BigEndian, LittleEndian};

use crate::Ros2Message;

/// Plain CDR, little-endian, without options.
const LITTLE_ENDIAN: [u8; 4] = [0, 1, 0, 0];

/// Returns the sentence on bytes that are not a message of a type.
pub(crate) fn bad<T: Ros2Message>(reason: impl Display) -> String {
    format!("{}: {reason}", T::DEFINITION.type_name())
}

fn bad_content<T: Ros2Message>(bytes: usize, error: &cdr_encoding::Error) -> String {
    bad::<T>(format_args!("{error} in a message of {bytes} bytes"))
}

/// Returns a message as little-endian CDR, as `rosbag2` stores it and DDS sends it.
pub fn encode<T: Ros2Message>(message: &T) -> Result<Vec<u8>, String> {
    let mut bytes = LITTLE_ENDIAN.to_vec();
    cdr_encoding::to_writer::<_, LittleEndian, _>(&mut bytes, message)
        .map_err(|error| bad_content::<T>(0, &error))?;
    Ok(bytes)
}

/// Returns the message in these bytes. What follows it is padding. It allocates no more than the
/// bytes hold, whatever lengths they give.
pub fn decode<T: Ros2Message>(bytes: &[u8]) -> Result<T, String> {
    let (head, content) = bytes.split_at(bytes.len().min(LITTLE_ENDIAN.len()));
    let decoded = match head {
        [0, 0, _, _] => cdr_encoding::from_bytes::<T, BigEndian>(content),
        [0, 1, _, _] => cdr_encoding::from_bytes::<T, LittleEndian>(content),
        _ => {
            return Err(bad::<T>(format_args!(
                "{head:02x?} does not begin a message in CDR, expected [00, 00] or [00, 01]"
            )));
        }
    };
    let (message, _) = decoded.map_err(|error| bad_content::<T>(bytes.len(), &error))?;
    Ok(message)
}
