//! Messages as bytes, appended to a buffer.

use crate::configuration::{CONFIGURATION_BYTES, Configuration, RESOLUTION_FIELD};
use crate::message::{
    AZIMUTH_BYTES, Azimuth, MAX_PAYLOAD_BYTES, Powers, Request, SIGNATURE, VERSION, id,
};
use crate::protobuf::FOUR_BYTES;

pub fn write_configuration(out: &mut Vec<u8>, configuration: &Configuration) {
    let tag = (RESOLUTION_FIELD << 3 | FOUR_BYTES) as u8;
    let resolution = configuration.range_resolution_m;
    let protobuf_bytes = if resolution.is_some() { 5 } else { 0 };
    write_header(out, id::CONFIGURATION, CONFIGURATION_BYTES + protobuf_bytes);
    for number in [
        configuration.azimuth_samples,
        configuration.bin_size,
        configuration.range_in_bins,
        configuration.encoder_size,
        configuration.rotation_mhz,
        configuration.packet_rate,
    ] {
        out.extend(number.to_be_bytes());
    }
    out.extend(configuration.range_gain.to_be_bytes());
    out.extend(configuration.range_offset.to_be_bytes());
    if let Some(metres) = resolution {
        out.push(tag);
        out.extend(metres.to_le_bytes());
    }
}

/// Appends an azimuth. [`ClockFormat::fields`](crate::ClockFormat::fields) gives its time. Powers
/// that do not fit into a message of [`MAX_PAYLOAD_BYTES`] are cut.
pub fn write_azimuth(out: &mut Vec<u8>, azimuth: &Azimuth<'_>) {
    let id = match azimuth.powers {
        Powers::Eight(_) => id::AZIMUTH,
        Powers::Sixteen(_) => id::AZIMUTH_16_BIT,
    };
    let powers = azimuth.powers.bytes();
    let powers = &powers[..powers.len().min(MAX_PAYLOAD_BYTES - AZIMUTH_BYTES)];
    write_header(out, id, AZIMUTH_BYTES + powers.len());
    out.extend((AZIMUTH_BYTES as u16).to_be_bytes());
    out.extend(azimuth.sweep_counter.to_be_bytes());
    out.extend(azimuth.encoder.to_be_bytes());
    out.extend(azimuth.seconds);
    out.extend(azimuth.split_seconds);
    out.extend_from_slice(powers);
}

pub fn write_keep_alive(out: &mut Vec<u8>) {
    write_header(out, id::KEEP_ALIVE, 0);
}

pub fn write_request(out: &mut Vec<u8>, request: Request) {
    write_header(out, request.id(), 0);
}

/// Appends any other message. A payload longer than [`MAX_PAYLOAD_BYTES`] is cut.
pub fn write_other(out: &mut Vec<u8>, id: u8, payload: &[u8]) {
    let payload = &payload[..payload.len().min(MAX_PAYLOAD_BYTES)];
    write_header(out, id, payload.len());
    out.extend_from_slice(payload);
}

/// `payload_bytes` is at most [`MAX_PAYLOAD_BYTES`].
fn write_header(out: &mut Vec<u8>, id: u8, payload_bytes: usize) {
    out.extend(SIGNATURE);
    out.extend([VERSION, id]);
    out.extend((payload_bytes as u32).to_be_bytes());
}
