//! Scans, rasters and points, made small for a browser: a header in JSON and compressed bytes.

use std::io::{self, Write};

use axum::body::Bytes;
use flate2::{Compression, write::DeflateEncoder};
use gyre_contract::MaskedHeader;
use gyre_geometry::{PolarScan, Sense, SparsePoint};
use ndarray::ArrayView2;
use serde::Serialize;
use serde_json::json;

/// The most azimuths of a picture: no Navtech radar measures more.
const MAX_AZIMUTHS: usize = 400;
/// The most range bins of a picture: a display has about as many pixels from middle to edge.
const MAX_BINS: usize = 256;
const MAX_SIDE: usize = 256;
/// Bits of a power that are dropped: 32 shades remain, and a scan compresses to a third.
const DROPPED_BITS: u32 = 3;
const NOISE_SHARE: f64 = 0.6;
/// Unit of the coordinates of points, m: 16 bits reach 655 m.
const POINT_UNIT_M: f64 = 0.02;

/// Makes a picture of a scan: the strongest return in each cell. Azimuth `a` looks at
/// `2 pi a / azimuths`, counter-clockwise from straight ahead.
pub fn scan(scan: &PolarScan<'_>, seq: u64, number: u64) -> io::Result<Bytes> {
    let geometry = &scan.geometry;
    let azimuths = geometry.azimuths.min(MAX_AZIMUTHS);
    let bins_of_one = geometry.bins.div_ceil(MAX_BINS).max(1);
    let bins = geometry.bins.div_ceil(bins_of_one);
    let mut powers = vec![0; azimuths * bins];
    let column = |row: usize| column_of(scan.azimuth_rad[row], geometry.sense, azimuths);
    for row in 0..geometry.azimuths {
        let first = column(row) * bins;
        let cells = powers[first..first + bins].iter_mut();
        for (cell, powers) in cells.zip(scan.row(row).chunks(bins_of_one)) {
            let strongest = powers.iter().max().copied().unwrap_or_default();
            *cell = strongest.max(*cell);
        }
    }
    let floor = floor(&powers);
    for power in &mut powers {
        *power = match *power < floor {
            true => 0,
            false => *power >> DROPPED_BITS << DROPPED_BITS,
        };
    }
    let picture = json!({
        "kind": "scan",
        "seq": seq,
        "scan": number,
        "azimuths": azimuths,
        "bins": bins,
        // Of the outer edge of the last bin.
        "max_range_m": f64::from(scan.range_m((bins * bins_of_one) as f32 - 0.5)),
        // Weaker powers are noise, and sent as 0.
        "floor": floor,
    });
    encode(&picture, &powers)
}

/// Returns the power below which most cells are.
fn floor(powers: &[u8]) -> u8 {
    let mut counts = [0_usize; 256];
    for power in powers {
        counts[usize::from(*power)] += 1;
    }
    let noise = (powers.len() as f64 * NOISE_SHARE) as usize;
    let mut below = 0;
    let is_above = |count: &usize| {
        below += count;
        below > noise
    };
    counts.iter().position(is_above).unwrap_or_default() as u8
}

/// Returns the column of an azimuth in a picture, counter-clockwise from straight ahead.
fn column_of(azimuth_rad: f32, sense: Sense, azimuths: usize) -> usize {
    let turns = f64::from(azimuth_rad) / std::f64::consts::TAU;
    let counter_clockwise = match sense {
        Sense::Clockwise => -turns,
        Sense::CounterClockwise => turns,
    };
    (counter_clockwise.rem_euclid(1.0) * azimuths as f64).round() as usize % azimuths
}

/// Makes a picture of a masked raster: the strongest value of each cell, relative to the maximum.
/// Row 0 is far ahead, column 0 far left.
pub fn raster(raster: ArrayView2<'_, f32>, cell_m: f32, seq: u64) -> io::Result<Bytes> {
    let n = raster.nrows();
    let cells_of_one = n.div_ceil(MAX_SIDE).max(1);
    let side = n.div_ceil(cells_of_one);
    let strongest = raster.iter().copied().fold(0.0, f32::max);
    let scale = match strongest > 0.0 {
        true => 255.0 / strongest,
        false => 0.0,
    };
    let mut cells = vec![0_u8; side * side];
    for ((row, column), value) in raster.indexed_iter() {
        let cell = &mut cells[row / cells_of_one * side + column / cells_of_one];
        *cell = ((value * scale) as u8 >> DROPPED_BITS << DROPPED_BITS).max(*cell);
    }
    let width_m = (side * cells_of_one) as f64 * f64::from(cell_m);
    let picture = json!({"kind": "raster", "seq": seq, "side": side, "width_m": width_m});
    encode(&picture, &cells)
}

/// Points of a scan as x and y in units of [`POINT_UNIT_M`], 16 bits each, little-endian, in
/// the frame of the scan.
pub struct PackedPoints(Vec<u8>);

/// Returns the points of a scan, motion-compensated as its raster is.
pub fn points(points: &[SparsePoint], header: &MaskedHeader) -> PackedPoints {
    let in_units = |length_m: f64| {
        let units = (length_m / POINT_UNIT_M).round();
        units.clamp(i16::MIN.into(), i16::MAX.into()) as i16
    };
    let places = header.deskewed(points);
    let bytes = places.flat_map(|(place, _)| place.map(in_units).map(i16::to_le_bytes));
    PackedPoints(bytes.flatten().collect())
}

impl PackedPoints {
    /// Makes a message of the points and the pose of their scan.
    pub fn at(&self, pose: [f64; 3], seq: u64) -> io::Result<Bytes> {
        let picture = json!({"kind": "points", "seq": seq, "pose": pose, "unit_m": POINT_UNIT_M});
        encode(&picture, &self.0)
    }
}

/// A message to the page: the length of the header (u32, little-endian), the header in JSON, and
/// the payload, deflated (RFC 1951).
fn encode(header: &impl Serialize, payload: &[u8]) -> io::Result<Bytes> {
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

#[cfg(test)]
mod tests {
    use std::f32::consts::TAU;

    use gyre_geometry::{OwnedScan, SweepGeometry};
    use ndarray::Array2;

    use super::*;

    const AZIMUTHS: usize = 800;
    const BINS: usize = 1000;

    /// Returns the picture of a clockwise scan with one strong return.
    fn picture(azimuth: usize, bin: usize) -> (serde_json::Value, Vec<u8>) {
        let mut sweep = OwnedScan::of(SweepGeometry {
            azimuths: AZIMUTHS,
            bins: BINS,
            stride: BINS,
            range_resolution_m: 0.2,
            ..SweepGeometry::default()
        });
        sweep.bytes.fill(10);
        sweep.bytes[azimuth * BINS + bin] = 255;
        sweep.azimuth_rad = (0..AZIMUTHS).map(|a| a as f32 * TAU / 800.0).collect();
        sweep.stamp_ns = (0..AZIMUTHS as i64).map(|a| a * 312_500).collect();
        decode(&scan(&sweep.view(), 7, 9).unwrap()).unwrap()
    }

    #[test]
    fn a_strong_return_survives_in_its_place() {
        let (header, powers) = picture(200, 500);
        let [azimuths, bins] = ["azimuths", "bins"].map(|key| header[key].as_u64().unwrap());
        assert_eq!((azimuths, bins), (400, 250));
        assert_eq!(powers.len() as u64, azimuths * bins);
        assert!((header["max_range_m"].as_f64().unwrap() - 200.0).abs() < 1e-3);
        // A quarter of a turn clockwise is three quarters counter-clockwise; half of the range.
        let brightest = powers.iter().position(|power| *power == 248).unwrap();
        assert_eq!((brightest / 250, brightest % 250), (300, 125));
        assert_eq!(powers.iter().filter(|power| **power != 8).count(), 1);
        let (_, of_last) = picture(AZIMUTHS - 1, 0);
        assert!(of_last.contains(&248));
    }

    #[test]
    fn a_raster_keeps_its_strongest_cells() {
        let mut cells = Array2::zeros((511, 511));
        cells[[0, 510]] = 0.5_f32;
        cells[[255, 255]] = 0.25;
        let (header, bytes) = decode(&raster(cells.view(), 0.4, 3).unwrap()).unwrap();
        let side = header["side"].as_u64().unwrap() as usize;
        assert_eq!((side, bytes.len()), (256, 256 * 256));
        assert!((header["width_m"].as_f64().unwrap() - 204.8).abs() < 1e-3);
        assert_eq!((bytes[255], bytes[127 * 256 + 127]), (248, 120));
        let dark = raster(Array2::zeros((3, 3)).view(), 0.4, 3).unwrap();
        assert_eq!(decode(&dark).unwrap().1, [0; 9]);
    }

    #[test]
    fn points_keep_their_place_to_two_centimetres() {
        let point = |x_m, y_m, weight| SparsePoint {
            x_m,
            y_m,
            weight,
            time_s: 0.0,
            doppler_s: 0.0,
        };
        let seen = [(1.0, -2.0, 1.0), (5.0, 5.0, 0.0), (1e9, 0.0, 0.5)];
        let seen = seen.map(|(x_m, y_m, weight)| point(x_m, y_m, weight));
        let small = points(&seen, &MaskedHeader::default());
        let (header, bytes) = decode(&small.at([1.0, 2.0, 3.0], 4).unwrap()).unwrap();
        assert_eq!(header["pose"], serde_json::json!([1.0, 2.0, 3.0]));
        let values = [50, -100, i16::MAX, 0].map(i16::to_le_bytes);
        assert_eq!(bytes, values.concat());
    }
}
