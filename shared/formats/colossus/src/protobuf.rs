//! The fields of a protobuf.

use crate::malformed::Malformed;

/// The wire type of a float.
pub(crate) const FOUR_BYTES: u64 = 5;

#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) enum Value<'a> {
    Number(u64),
    Float(f32),
    Bytes(&'a [u8]),
    EightBytes,
}

impl Value<'_> {
    pub(crate) fn float(self) -> Option<f32> {
        match self {
            Self::Float(value) => Some(value),
            _ => None,
        }
    }

    pub(crate) fn number(self) -> Option<u64> {
        match self {
            Self::Number(value) => Some(value),
            _ => None,
        }
    }
}

/// Calls `each` with number and value of each field, in order. The last one of a number counts, as
/// protobuf requires.
pub(crate) fn fields<'a>(
    message: &str,
    protobuf: &'a [u8],
    mut each: impl FnMut(u64, Value<'a>) -> Result<(), Malformed>,
) -> Result<(), Malformed> {
    let mut rest = protobuf;
    while !rest.is_empty() {
        let (number, value, after) = field(rest).ok_or_else(|| {
            let at = protobuf.len() - rest.len();
            Malformed::new(format!(
                "the protobuf of {message} is malformed at byte {at}"
            ))
        })?;
        each(number, value)?;
        rest = after;
    }
    Ok(())
}

fn field(protobuf: &[u8]) -> Option<(u64, Value<'_>, &[u8])> {
    let (tag, rest) = varint(protobuf)?;
    let number = tag >> 3;
    if number == 0 {
        return None;
    }
    match tag & 7 {
        0 => {
            let (value, after) = varint(rest)?;
            Some((number, Value::Number(value), after))
        }
        1 => Some((number, Value::EightBytes, rest.get(8..)?)),
        2 => {
            let (length, rest) = varint(rest)?;
            let (bytes, after) = rest.split_at_checked(usize::try_from(length).ok()?)?;
            Some((number, Value::Bytes(bytes), after))
        }
        FOUR_BYTES => {
            let (bytes, after) = rest.split_first_chunk()?;
            Some((number, Value::Float(f32::from_le_bytes(*bytes)), after))
        }
        // Groups are not of this version of protobuf, the others of none.
        _ => None,
    }
}

/// Returns a number of seven bits a byte, least significant first, and what follows.
fn varint(bytes: &[u8]) -> Option<(u64, &[u8])> {
    let mut number = 0;
    for (k, byte) in bytes.iter().take(10).enumerate() {
        // The tenth byte has one bit of 64.
        if k == 9 && *byte > 1 {
            return None;
        }
        number |= u64::from(byte & 0x7f) << (7 * k);
        if byte & 0x80 == 0 {
            return Some((number, &bytes[k + 1..]));
        }
    }
    None
}
