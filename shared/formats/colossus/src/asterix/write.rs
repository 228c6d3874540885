//! Azimuths as datagrams, as a radar sends them.

use super::{ANGLES, BLOCK_BYTES, CATEGORY, FEMTO, HALF_C_MPS, SPECIAL_BYTES, VIDEO};
use crate::clock::ClockFormat;
use crate::configuration::Configuration;
use crate::message::{Azimuth, Powers};

/// The bytes of a datagram that a radar sends unless it is configured otherwise, at most.
pub const MAX_DATAGRAM_BYTES: usize = 1400;
/// Bytes before the powers, their padding to a block of 64 bytes, time of day and special purpose
/// field.
const OVERHEAD_BYTES: usize = 32 + 63 + 3 + SPECIAL_BYTES;
/// Data source, message type, number, femtosecond header and resolution; more follow: size, blocks
/// of 64 bytes, time, special.
const FEATURES: [u8; 2] = [0b1110_0111, 0b1010_1010];
/// The identification that Navtech's library gives a radar.
const SOURCE: [u8; 2] = [0xca, 0xfe];
/// All healthy, as Navtech's library writes it.
const HEALTHY: u16 = 0b1010_1010_1010_1010;

/// Hands the datagrams of an azimuth to `send`, each with the next `number`. The time must be
/// big-endian seconds and nanoseconds: see [`ClockFormat::fields`](crate::ClockFormat::fields). Its
/// bins are as configured.
pub fn write_azimuth(
    radar: &Configuration,
    azimuth: &Azimuth<'_>,
    number: &mut u32,
    send: &mut dyn FnMut(&[u8]),
) {
    let (bin_bytes, powers) = match azimuth.powers {
        Powers::Eight(powers) => (1, powers),
        Powers::Sixteen(powers) => (2, powers),
    };
    // Whole blocks, so that only the last datagram has padding.
    let part = (MAX_DATAGRAM_BYTES - OVERHEAD_BYTES) / BLOCK_BYTES[1] * BLOCK_BYTES[1];
    let mut datagram = Vec::with_capacity(MAX_DATAGRAM_BYTES);
    for (k, powers) in powers.chunks(part).enumerate() {
        datagram.clear();
        let first = k * part / bin_bytes;
        write(
            &mut datagram,
            radar,
            azimuth,
            *number,
            (first, bin_bytes, powers),
        );
        *number = number.wrapping_add(1);
        send(&datagram);
    }
}

/// Appends a message that describes the radar and has no powers.
pub fn write_description(out: &mut Vec<u8>, radar: &Configuration, number: u32) {
    let azimuth = Azimuth::at(0, 0, ClockFormat::default(), &[]);
    write(out, radar, &azimuth, number, (0, 1, &[]));
}

/// Appends a message of some bins of an azimuth: the first, the bytes of each, and their powers.
fn write(
    out: &mut Vec<u8>,
    radar: &Configuration,
    azimuth: &Azimuth<'_>,
    number: u32,
    (first, bin_bytes, powers): (usize, usize, &[u8]),
) {
    let begin = out.len();
    let size = u32::from(radar.encoder_size.max(1));
    let angle = |encoder: u32| (f64::from(encoder % size) / f64::from(size) * ANGLES) as u16;
    let encoder = u32::from(azimuth.encoder);
    let step = radar.step().round() as u32;
    let resolution_m = f64::from(radar.range_resolution_m());
    let blocks = powers.len().div_ceil(BLOCK_BYTES[1]);
    out.extend([CATEGORY, 0, 0]);
    out.extend(FEATURES);
    out.extend(SOURCE);
    out.push(VIDEO);
    out.extend(number.to_be_bytes());
    out.extend(angle(encoder).to_be_bytes());
    out.extend(angle(encoder + step).to_be_bytes());
    out.extend((first as u32).to_be_bytes());
    out.extend(((resolution_m / HALF_C_MPS * FEMTO).round() as u32).to_be_bytes());
    out.extend([0, 3 + bin_bytes as u8]);
    out.extend((powers.len() as u16).to_be_bytes());
    out.extend(&((powers.len() / bin_bytes) as u32).to_be_bytes()[1..]);
    out.push(blocks as u8);
    out.extend_from_slice(powers);
    let padding = blocks * BLOCK_BYTES[1] - powers.len();
    out.resize(out.len() + padding, 0);
    write_end(out, radar, azimuth);
    let length = (out.len() - begin) as u16;
    out[begin + 1..begin + 3].copy_from_slice(&length.to_be_bytes());
}

/// Appends the time of day, in 1/128 s, and the special purpose field.
fn write_end(out: &mut Vec<u8>, radar: &Configuration, azimuth: &Azimuth<'_>) {
    let seconds = u32::from_be_bytes(azimuth.seconds);
    let nanoseconds = u64::from(u32::from_be_bytes(azimuth.split_seconds));
    let of_second = (nanoseconds * 128 / 1_000_000_000) as u32;
    let time_of_day = seconds % 86_400 * 128 + of_second;
    out.extend(&time_of_day.to_be_bytes()[1..]);
    out.push(SPECIAL_BYTES as u8);
    out.extend(azimuth.seconds);
    out.extend(azimuth.split_seconds);
    out.extend(radar.azimuth_samples.to_be_bytes());
    out.extend(radar.range_in_bins.to_be_bytes());
    out.extend(radar.rotation_mhz.to_be_bytes());
    out.extend(radar.range_gain.to_be_bytes());
    out.extend(radar.range_offset.to_be_bytes());
    out.extend(HEALTHY.to_be_bytes());
}
