//! The radar's description of itself: 20 bytes, then a protobuf.

use gyre_geometry::MAX_AZIMUTHS;
use thiserror::Error;

use crate::{
    malformed::{Malformed, head},
    protobuf::fields,
};

/// Bytes before the protobuf.
pub(crate) const CONFIGURATION_BYTES: usize = 20;
/// The protobuf's field of the range resolution, a float.
pub(crate) const RESOLUTION_FIELD: u64 = 10;

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Configuration {
    /// Azimuths per turn.
    pub azimuth_samples: u16,
    /// Depth of a range bin, 1e-4 m: rounded, see [`Configuration::range_resolution_m()`].
    pub bin_size: u16,
    /// Range bins per azimuth, at most.
    pub range_in_bins: u16,
    /// Encoder counts per turn.
    pub encoder_size: u16,
    /// Turns per 1000 s.
    pub rotation_mhz: u16,
    /// Packets per second.
    pub packet_rate: u16,
    /// Factor of ranges. Not used.
    pub range_gain: f32,
    /// Offset of ranges. Not used: its unit and sign are not documented.
    pub range_offset: f32,
    /// Depth of a range bin from the protobuf, m.
    pub range_resolution_m: Option<f32>,
}

/// A configuration that no radar has.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("the radar's configuration gives {0}")]
pub struct BadConfiguration(String);

impl Configuration {
    /// A radar of so many azimuths and bins, with four turns per second and the usual encoder.
    pub fn usual(azimuth_samples: u16, range_in_bins: u16) -> Self {
        Self {
            azimuth_samples,
            bin_size: 438,
            range_in_bins,
            encoder_size: 5600,
            rotation_mhz: 4000,
            range_resolution_m: Some(0.04381),
            ..Self::default()
        }
    }

    /// Returns the depth of a range bin, m: the exact value of the protobuf if there is one,
    /// otherwise `bin_size`, which is rounded to 0.1 mm (0.04381 m becomes 0.0438).
    pub fn range_resolution_m(&self) -> f32 {
        // A protobuf leaves out zeros, so that a zero is no value.
        let exact = self.range_resolution_m.filter(|metres| *metres != 0.0);
        exact.unwrap_or((f64::from(self.bin_size) / 1e4) as f32)
    }

    pub fn period_ns(&self) -> i64 {
        let mhz = i64::from(self.rotation_mhz.max(1));
        (1_000_000_000_000 + mhz / 2) / mhz
    }

    /// Returns the number of encoder counts from one azimuth to the next.
    pub fn step(&self) -> f64 {
        f64::from(self.encoder_size.max(1)) / f64::from(self.azimuth_samples.max(1))
    }

    pub(crate) fn ns_per_count(&self) -> f64 {
        self.period_ns() as f64 / f64::from(self.encoder_size.max(1))
    }

    /// Rejects numbers that make no scan.
    pub fn check(&self) -> Result<(), BadConfiguration> {
        let (azimuths, any) = (f64::from(self.azimuth_samples), f64::from(u16::MAX));
        let (bins, counts) = (self.range_in_bins.into(), self.encoder_size.into());
        let (mhz, bin_m) = (self.rotation_mhz.into(), self.range_resolution_m().into());
        let (most, least) = (MAX_AZIMUTHS as f64, azimuths.max(16.0));
        let checks: [(_, f64, _); 5] = [
            ("the number of azimuths", azimuths, 2.0..=most),
            ("the number of range bins", bins, 1.0..=any),
            // Fewer counts than azimuths: two azimuths would have the same count.
            ("the encoder counts per turn", counts, least..=any),
            // A slower sweep lasts longer than motions are searched.
            ("the rotation in mHz", mhz, 100.0..=any),
            ("the depth of a range bin in m", bin_m, 1e-3..=10.0),
        ];
        let mut checks = checks.into_iter();
        match checks.find(|(_, value, bounds)| !bounds.contains(value)) {
            None => Ok(()),
            Some((what, value, bounds)) => {
                let (least, most) = (bounds.start(), bounds.end());
                let wrong = format!("{what} as {value}, expected {least} to {most}");
                Err(BadConfiguration(wrong))
            }
        }
    }
}

pub(crate) fn decode(payload: &[u8]) -> Result<Configuration, Malformed> {
    let head: [u8; CONFIGURATION_BYTES] = head("a configuration", payload)?;
    let number = |k: usize| u16::from_be_bytes([head[2 * k], head[2 * k + 1]]);
    let float =
        |at: usize| f32::from_be_bytes([head[at], head[at + 1], head[at + 2], head[at + 3]]);
    Ok(Configuration {
        azimuth_samples: number(0),
        bin_size: number(1),
        range_in_bins: number(2),
        encoder_size: number(3),
        rotation_mhz: number(4),
        packet_rate: number(5),
        range_gain: float(12),
        range_offset: float(16),
        range_resolution_m: resolution(&payload[CONFIGURATION_BYTES..])?,
    })
}

/// Returns the range resolution in a protobuf; all other fields are skipped.
fn resolution(protobuf: &[u8]) -> Result<Option<f32>, Malformed> {
    let mut found = None;
    fields("a configuration", protobuf, |number, value| {
        if number == RESOLUTION_FIELD {
            found = value.float().or(found);
        }
        Ok(())
    })?;
    Ok(found)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn assert_malformed(protobuf: &[u8], at: usize) {
        let refused = resolution(protobuf).unwrap_err().to_string();
        let expected = format!("the protobuf of a configuration is malformed at byte {at}");
        assert_eq!(refused, expected, "{protobuf:?}");
    }

    #[test]
    fn the_resolution_is_found_among_fields_of_all_types() {
        let float = 0.04381_f32.to_le_bytes();
        let mut bytes = vec![0x08, 0x96, 0x01]; // field 1, varint 150
        bytes.extend([0x11, 1, 2, 3, 4, 5, 6, 7, 8]); // field 2, eight bytes
        bytes.extend([0x1a, 3, b'C', b'T', b'S']); // field 3, text
        bytes.extend([0x25, 0, 0, 0, 0]); // field 4, float
        bytes.push(0x55);
        bytes.extend(float);
        bytes.extend([0x82, 0x01, 0]); // field 16, no bytes
        assert_eq!(resolution(&bytes).unwrap(), Some(0.04381));
        assert_eq!(resolution(&[]).unwrap(), None);
        assert_eq!(resolution(&bytes[..3]).unwrap(), None);
        for (cut, at) in [(2, 0), (5, 3), (15, 12), (24, 22), (26, 22)] {
            assert_malformed(&bytes[..cut], at);
        }
    }

    #[test]
    fn malformed_fields_are_refused() {
        let lengths = [
            0x1a, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 0xff, 1,
        ];
        for bytes in [
            &[0x05, 0, 0, 0, 0][..],
            &[0x0b],
            &[0x0e],
            &[0xff; 20],
            &lengths,
        ] {
            assert_malformed(bytes, 0);
        }
    }
}
