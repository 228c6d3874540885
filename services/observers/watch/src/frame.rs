//! Pictures as they are sent: a header in JSON and compressed bytes.

use std::io::Write;

use axum::body::Bytes;
use flate2::{Compression, write::DeflateEncoder};
use serde::Serialize;

/// A message to the page: the length of the header (u32, little-endian), the header in JSON, and
/// the payload, deflated (RFC 1951).
pub fn encode(header: &impl Serialize, payload: &[u8]) -> std::io::Result<Bytes> {
    let header = serde_json::to_vec(header)?;
    let mut message = (header.len() as u32).to_le_bytes().to_vec();
    message.extend(header);
    let mut encoder = DeflateEncoder::new(message, Compression::fast());
    encoder.write_all(payload)?;
    Ok(encoder.finish()?.into())
}

#[cfg(test)]
pub fn decode(message: &[u8]) -> Option<(serde_json::Value, Vec<u8>)> {
    use std::io::Read;
    let (length, rest) = message.split_first_chunk::<4>()?;
    let (header, deflated) = rest.split_at_checked(u32::from_le_bytes(*length) as usize)?;
    let mut payload = Vec::new();
    let mut decoder = flate2::read::DeflateDecoder::new(deflated);
    decoder.read_to_end(&mut payload).ok()?;
    Some((serde_json::from_slice(header).ok()?, payload))
}
