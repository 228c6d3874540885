//! The powers of a Navtech radar by UDP: video messages of ASTERIX, category 240, with Navtech's
//! special purpose field.
//!
//! Navtech's own messages by UDP (at 239.69.69.69:6317) have other ids than those by TCP, and none
//! of them carries powers: 10 discovery, 20 network settings, 30 keep-alive, 40 the radar's own
//! detections. A radar sends its powers by UDP when its data output is set to CAT-240: to one
//! address or to a multicast group.
//!
//! Sources: EUROCONTROL's specification of category 240, edition 1.3, for the items and their
//! order; Navtech's public IASDK, `cpp_17/src/network/protocols/CAT_240/messages`, for what stands
//! in them and for the special purpose field; `Colossus/UDP/messages` of the same for the ids
//! above. All numbers are big-endian.
//!
//! An azimuth has more bytes than a datagram should have, so the radar sends it in several
//! messages: each has the number of its first bin, and repeats angle, time and description.
//! [`Datagrams`] puts them together.

mod datagrams;
mod write;

pub use datagrams::Datagrams;
pub use write::{MAX_DATAGRAM_BYTES, write_azimuth, write_description};

use crate::{configuration::Configuration, malformed::Malformed, message::MAX_PAYLOAD_BYTES};

/// The category of ASTERIX: the first byte of a message.
const CATEGORY: u8 = 240;
/// The message type of a video message.
const VIDEO: u8 = 2;
/// Angles in a turn.
const ANGLES: f64 = 65_536.0;
/// Half the speed of light, m/s: a bin's depth per second of its duration.
const HALF_C_MPS: f64 = 299_792_458.0 / 2.0;
/// Femtoseconds, and nanoseconds, in a second.
const FEMTO: f64 = 1e15;
const NANO: f64 = 1e9;
/// The special purpose field: its own length, time, azimuths, bins, rotation, gain, offset, health.
const SPECIAL_BYTES: usize = 25;
/// The item of cells, in the order of the specification, and the bytes of one block of it.
const BLOCK_BYTES: [usize; 3] = [4, 64, 256];
/// Version and ids of Navtech's own messages by UDP, which carry no powers.
const COLOSSUS_UDP_VERSION: u8 = 2;
const COLOSSUS_UDP_IDS: std::ops::RangeInclusive<u8> = 10..=50;

#[derive(Clone, Copy, Debug, PartialEq)]
struct Video<'a> {
    /// Number of the message, incremented with each one; wraps.
    number: u32,
    /// Angle of the antenna, in 1/65536 of a turn, rounded down.
    angle: u16,
    resolution_m: f32,
    first: usize,
    /// Bytes per bin, 1 or 2.
    bin_bytes: usize,
    powers: &'a [u8],
    special: Special,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Special {
    seconds: [u8; 4],
    nanoseconds: [u8; 4],
    azimuths: u16,
    bins: u16,
    rotation_mhz: u16,
}

impl Video<'_> {
    /// Returns the message's description of the radar, whose encoder has `encoder_size` counts per
    /// turn.
    fn configuration(&self, encoder_size: u16) -> Configuration {
        Configuration {
            azimuth_samples: self.special.azimuths,
            bin_size: (f64::from(self.resolution_m) * 1e4).round() as u16,
            range_in_bins: self.special.bins,
            encoder_size,
            rotation_mhz: self.special.rotation_mhz,
            range_resolution_m: Some(self.resolution_m),
            ..Configuration::default()
        }
    }
}

/// Returns the encoder count of an angle. The angle was rounded down, by less than a count of any
/// encoder of up to 32,768.
fn encoder(angle: u16, encoder_size: u16) -> u16 {
    let size = encoder_size.max(1);
    let count = (f64::from(angle) + 0.5) / ANGLES * f64::from(size);
    count.round() as u16 % size
}

struct Items<'a> {
    rest: &'a [u8],
}

impl<'a> Items<'a> {
    fn take<const N: usize>(&mut self, item: &str) -> Result<[u8; N], Malformed> {
        let split = self.rest.split_first_chunk();
        let (bytes, rest) = split.ok_or_else(|| short(item))?;
        self.rest = rest;
        Ok(*bytes)
    }

    fn bytes(&mut self, count: usize, item: &str) -> Result<&'a [u8], Malformed> {
        let split = self.rest.split_at_checked(count);
        let (bytes, rest) = split.ok_or_else(|| short(item))?;
        self.rest = rest;
        Ok(bytes)
    }

    /// Takes an item that begins with its own length, which it has at least; returns it without
    /// that byte.
    fn counted(&mut self, item: &str, at_least: usize) -> Result<&'a [u8], Malformed> {
        let [length] = self.take(item)?;
        match usize::from(length) {
            length if length >= at_least => self.bytes(length - 1, item),
            _ => Err(short(item)),
        }
    }

    fn blocks(&mut self, block: usize, item: &str) -> Result<&'a [u8], Malformed> {
        let [blocks] = self.take(item)?;
        self.bytes(usize::from(blocks) * block, item)
    }
}

fn short(item: &str) -> Malformed {
    Malformed::new(format!("a message ends within its item {item}"))
}

fn missing(item: &str) -> Malformed {
    Malformed::new(format!("a message lacks the item {item}"))
}

fn require(has: u16, bit: u32, item: &str) -> Result<(), Malformed> {
    match has & 1 << bit {
        0 => Err(missing(item)),
        _ => Ok(()),
    }
}

fn bad_cells([cells, first, bytes, bins]: [usize; 4]) -> Malformed {
    Malformed::new(format!(
        "a message has {cells} bins from bin {first} in {bytes} bytes, of {bins} bins"
    ))
}

/// Decodes a datagram; `None` if it is a message without powers, such as a summary.
fn decode(datagram: &[u8]) -> Result<Option<Video<'_>>, Malformed> {
    let mut items = Items { rest: datagram };
    let [category, l0, l1] = items.take("length")?;
    check_category(category, l0)?;
    let expected = usize::from(u16::from_be_bytes([l0, l1]));
    if expected != datagram.len() {
        let actual = datagram.len();
        let sentence = format!("a message of {expected} bytes is in a datagram of {actual}");
        return Err(Malformed::new(sentence));
    }
    let has = features(&mut items)?;
    if has & 1 << 13 != 0 {
        let _source: [u8; 2] = items.take("I240/010")?;
    }
    if has & 1 << 12 == 0 || items.take("I240/000")? != [VIDEO] {
        return Ok(None);
    }
    require(has, 11, "I240/020")?;
    let number = u32::from_be_bytes(items.take("I240/020")?);
    if has & 1 << 10 != 0 {
        items.blocks(1, "I240/030")?;
    }
    let (angle, first, resolution_m) = header(&mut items, has)?;
    let (bin_bytes, powers) = cells(&mut items, has)?;
    if has & 1 << 2 != 0 {
        let _time_of_day: [u8; 3] = items.take("I240/140")?;
    }
    if has & 1 << 1 != 0 {
        items.counted("RE", 1)?;
    }
    require(has, 0, "SP")?;
    let special = special(&mut items)?;
    let bins = usize::from(special.bins);
    let cells = powers.len() / bin_bytes;
    if first.saturating_add(cells) > bins {
        return Err(bad_cells([cells, first, powers.len(), bins]));
    }
    Ok(Some(Video {
        number,
        angle,
        resolution_m,
        first,
        bin_bytes,
        powers,
        special,
    }))
}

fn check_category(category: u8, second: u8) -> Result<(), Malformed> {
    Err(Malformed::new(match category {
        CATEGORY => return Ok(()),
        COLOSSUS_UDP_VERSION if COLOSSUS_UDP_IDS.contains(&second) => format!(
            "Navtech's message {second} by UDP carries no powers: set the radar's data output to CAT-240"
        ),
        other => {
            format!("a datagram begins with {other}, expected the category {CATEGORY} of ASTERIX")
        }
    }))
}

/// Returns which items follow: 14 bits, the first item in the highest one.
fn features(items: &mut Items<'_>) -> Result<u16, Malformed> {
    let [first] = items.take("FSPEC")?;
    let second = match first & 1 {
        0 => 0,
        _ => items.take::<1>("FSPEC")?[0],
    };
    if second & 1 != 0 {
        // The specification has no third byte.
        return Err(missing("end of FSPEC"));
    }
    Ok(u16::from(first >> 1) << 7 | u16::from(second >> 1))
}

/// Takes the angle, the first bin and the depth of a bin, m.
fn header(items: &mut Items<'_>, has: u16) -> Result<(u16, usize, f32), Malformed> {
    let (bytes, per_second): ([u8; 12], f64) = if has & 1 << 9 != 0 {
        (items.take("I240/040")?, NANO)
    } else if has & 1 << 8 != 0 {
        (items.take("I240/041")?, FEMTO)
    } else {
        return Err(missing("I240/041"));
    };
    let [a0, a1, _, _, f0, f1, f2, f3, d0, d1, d2, d3] = bytes;
    let duration = u32::from_be_bytes([d0, d1, d2, d3]);
    let metres = f64::from(duration) / per_second * HALF_C_MPS;
    let first = u32::from_be_bytes([f0, f1, f2, f3]) as usize;
    // A femtosecond is 0.15 um; depths are given in micrometres at the finest.
    let resolution_m = ((metres * 1e6).round() / 1e6) as f32;
    Ok((u16::from_be_bytes([a0, a1]), first, resolution_m))
}

/// Takes the powers, without the padding of their blocks.
fn cells<'a>(items: &mut Items<'a>, has: u16) -> Result<(usize, &'a [u8]), Malformed> {
    require(has, 7, "I240/048")?;
    let [compression, resolution] = items.take("I240/048")?;
    let compressed = compression & 0x80 != 0;
    let bin_bytes = match (compressed, resolution) {
        (false, 4) => 1,
        (false, 5) => 2,
        _ => {
            return Err(Malformed::new(format!(
                "a message has powers of resolution {resolution} (4: 8 bits, 5: 16 bits), compressed: {compressed}"
            )));
        }
    };
    require(has, 6, "I240/049")?;
    let [b0, b1, c0, c1, c2] = items.take("I240/049")?;
    let bytes = usize::from(u16::from_be_bytes([b0, b1]));
    let cells = u32::from_be_bytes([0, c0, c1, c2]) as usize;
    let mut blocks: &[u8] = &[];
    for (k, block) in BLOCK_BYTES.into_iter().enumerate() {
        if has & 1 << (5 - k) != 0 {
            blocks = items.blocks(block, "I240/050")?;
        }
    }
    let powers = blocks.get(..bytes).filter(|_| bytes == cells * bin_bytes);
    let powers = powers.ok_or_else(|| bad_cells([cells, 0, bytes, MAX_PAYLOAD_BYTES]))?;
    Ok((bin_bytes, powers))
}

fn special(items: &mut Items<'_>) -> Result<Special, Malformed> {
    let field = items.counted("SP", SPECIAL_BYTES)?;
    let short = |at: usize| u16::from_be_bytes([field[at], field[at + 1]]);
    let long = |at: usize| [field[at], field[at + 1], field[at + 2], field[at + 3]];
    Ok(Special {
        seconds: long(0),
        nanoseconds: long(4),
        azimuths: short(8),
        bins: short(10),
        rotation_mhz: short(12),
    })
}
