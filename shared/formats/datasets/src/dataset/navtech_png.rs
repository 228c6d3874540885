//! The metadata columns that Navtech drivers store before the powers of each row: stamp, encoder
//! count, one byte of flags.

use std::{f64::consts::TAU, path::Path};

use gyre_geometry::scan::{check_sweep, flag};

use super::{error::ReadError, png_image::ImageSize, stamp};

pub(crate) const METADATA_BYTES: usize = 11;
/// Minimum share of consecutive rows that differ in byte 10 if it is the direction of the chirp.
const ALTERNATING_SHARE: f64 = 0.9;
/// Maximum share of a turn that no row is in: more is a part of a turn, or the encoder has another
/// size.
const MAX_GAP_SHARE: f64 = 0.25;

#[derive(Clone, Copy, Debug)]
pub(crate) struct RowMetadata {
    /// Bytes 0 to 7, little-endian: time since 1970, us or ns.
    pub(crate) stamp: i64,
    pub(crate) count: u16,
    pub(crate) byte_ten: u8,
}

impl RowMetadata {
    pub(crate) fn parse(row: &[u8]) -> Self {
        let mut stamp = [0; 8];
        stamp.copy_from_slice(&row[..8]);
        Self {
            stamp: i64::from_le_bytes(stamp),
            count: u16::from_le_bytes([row[8], row[9]]),
            byte_ten: row[10],
        }
    }
}

/// Returns the metadata of each row of an image wider than [`METADATA_BYTES`].
pub(crate) fn rows(
    pixels: &[u8],
    size: ImageSize,
) -> impl Iterator<Item = RowMetadata> + Clone + '_ {
    let rows = pixels.chunks_exact(size.width).take(size.height);
    rows.map(RowMetadata::parse)
}

/// Returns whether byte 10 alternates between 0 and 255 from row to row. Then it is the direction
/// of the chirp, not validity.
pub(crate) fn chirps_alternate(bytes_ten: impl Iterator<Item = u8>) -> bool {
    let (mut pairs, mut changes, mut last) = (0_usize, 0_usize, None);
    for byte in bytes_ten {
        if !matches!(byte, 0 | 255) {
            return false;
        }
        if let Some(last) = last.replace(byte) {
            pairs += 1;
            changes += usize::from(last != byte);
        }
    }
    pairs > 0 && changes as f64 >= ALTERNATING_SHARE * pairs as f64
}

/// The meaning of byte 10 if it does not alternate.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ByteTen {
    /// 255: measured; otherwise interpolated from the neighbours.
    Validity,
    Unused,
}

pub(crate) fn fill_flags(pixels: &[u8], size: ImageSize, meaning: ByteTen, flags: &mut [u8]) {
    let chirps = chirps_alternate(rows(pixels, size).map(|row| row.byte_ten));
    for (row, into) in rows(pixels, size).zip(flags) {
        *into = match (chirps, meaning, row.byte_ten) {
            (true, _, 255) => flag::MEASURED | flag::CHIRP_KNOWN | flag::CHIRP_UP,
            (true, _, _) => flag::MEASURED | flag::CHIRP_KNOWN,
            (false, ByteTen::Validity, byte) if byte != 255 => 0,
            _ => flag::MEASURED,
        };
    }
}

/// Writes the angle of each row in `[0, 2 pi)`. Rejects rows that are not one sweep.
pub(crate) fn fill_azimuths(
    path: &Path,
    pixels: &[u8],
    size: ImageSize,
    counts: u16,
    azimuth_rad: &mut [f32],
) -> Result<(), ReadError> {
    check_order(path, rows(pixels, size).map(|row| row.count), counts)?;
    check_turn(path, rows(pixels, size).map(|row| row.count), counts)?;
    let step = TAU / f64::from(counts);
    for (row, into) in rows(pixels, size).zip(azimuth_rad) {
        *into = (f64::from(row.count % counts) * step) as f32;
    }
    Ok(())
}

/// Writes uniform angles: row `i` of `n` at `2 pi (first + i) / n`.
pub(crate) fn fill_uniform(azimuth_rad: &mut [f32], first: f64) {
    let step = TAU / azimuth_rad.len() as f64;
    for (row, into) in azimuth_rad.iter_mut().enumerate() {
        *into = ((first + row as f64) * step) as f32;
    }
}

/// Checks that the counts increase, with at most one wrap-around at zero and at most one turn.
fn check_order(
    path: &Path,
    row_counts: impl Iterator<Item = u16>,
    counts: u16,
) -> Result<(), ReadError> {
    let (mut first, mut last, mut wrapped) = (0, None, false);
    for (row, count) in row_counts.enumerate() {
        if count > counts {
            let fault = format!(
                "encoder count {count} exceeds {counts} counts per turn; set `encoder_counts`, or `azimuth_source = \"uniform\"`"
            );
            return Err(ReadError::row(path, row, fault));
        }
        let count = count % counts;
        match last.replace(count) {
            None => first = count,
            Some(previous) => {
                let wraps = count < previous;
                let lapped = (wrapped || wraps) && count >= first;
                if count == previous || lapped || (wraps && wrapped) {
                    let fault = format!(
                        "azimuth does not increase (encoder count {count} after {previous}); the rows are not one sweep"
                    );
                    return Err(ReadError::row(path, row, fault));
                }
                wrapped |= wraps;
            }
        }
    }
    Ok(())
}

/// Checks that counts in order leave out no more than [`MAX_GAP_SHARE`] of a turn in one place.
fn check_turn(
    path: &Path,
    row_counts: impl Iterator<Item = u16> + Clone,
    counts: u16,
) -> Result<(), ReadError> {
    let Some(first) = row_counts.clone().next() else {
        return Ok(());
    };
    let next = row_counts.clone().skip(1).chain([first]);
    let step =
        |(count, next): (u16, u16)| (i32::from(next) - i32::from(count)).rem_euclid(counts.into());
    let widest = row_counts.zip(next).map(step).max().unwrap_or(0);
    let gap = f64::from(widest) / f64::from(counts);
    if gap <= MAX_GAP_SHARE {
        return Ok(());
    }
    let gap_deg = 360.0 * gap;
    let fault = format!(
        ": no row is in {gap_deg:.0} degrees of the turn, for an encoder of {counts} counts per turn: the image holds a part of a turn, or `encoder_counts` is another number"
    );
    Err(ReadError::image(path, fault))
}

/// Writes the logged time of each row, ns. Rejects invalid times, and times that are not of one
/// sweep of at most `max_sweep_ns`.
pub(crate) fn fill_stamps(
    path: &Path,
    pixels: &[u8],
    size: ImageSize,
    max_sweep_ns: i64,
    stamp_ns: &mut [i64],
) -> Result<(), ReadError> {
    for (row, (metadata, into)) in rows(pixels, size).zip(stamp_ns.iter_mut()).enumerate() {
        let value = metadata.stamp;
        *into = stamp::to_ns(value).ok_or_else(|| {
            let fault = format!(
                "stamp {value} is not a time of the years 2015 to 2040 in s, ms, us or ns: the first 11 bytes of the row are not Navtech metadata"
            );
            ReadError::row(path, row, fault)
        })?;
    }
    check_sweep(&stamp_ns[..size.height], max_sweep_ns)
        .map_err(|fault| ReadError::image(path, format!(", {fault}")))
}

/// Replaces stamps that come in bursts (the rows of a packet share the time of receipt) by a linear
/// fit over the azimuth, shifted so that the middle of the sweep keeps its time: the mean of the
/// first and last row's stamps.
pub(crate) fn smooth_stamps(azimuth_rad: &[f32], stamp_ns: &mut [i64]) {
    let n = stamp_ns.len();
    if n < 2 {
        return;
    }
    let middle_ns = stamp::middle_ns(stamp_ns[0], stamp_ns[n - 1]);
    let first_rad = f64::from(azimuth_rad[0]);
    let angle = |row: usize| (f64::from(azimuth_rad[row]) - first_rad).rem_euclid(TAU);
    let mean_angle = (0..n).map(angle).sum::<f64>() / n as f64;
    let (mut covariance, mut variance) = (0.0, 0.0);
    for (row, stamp) in stamp_ns.iter().enumerate() {
        let from_mean = angle(row) - mean_angle;
        covariance += from_mean * (stamp - middle_ns) as f64;
        variance += from_mean * from_mean;
    }
    let ns_per_rad = covariance / variance;
    let middle_angle = angle(n - 1) / 2.0;
    for (row, stamp) in stamp_ns.iter_mut().enumerate() {
        *stamp = middle_ns + ((angle(row) - middle_angle) * ns_per_rad).round() as i64;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ordered(counts: &[u16]) -> Result<(), ReadError> {
        check_order(Path::new("scan.png"), counts.iter().copied(), 5600)
    }

    #[test]
    fn a_sweep_may_wrap_once_and_not_overlap_itself() {
        for counts in [
            &[13, 27, 5599][..],
            &[5000, 5599, 0, 4999],
            &[5000, 5600, 14],
        ] {
            assert!(ordered(counts).is_ok(), "{counts:?}");
        }
        for (counts, at) in [
            (&[5000, 0, 5000][..], 2),
            (&[5000, 10, 20, 15], 3),
            (&[10, 20, 15], 2),
            (&[10, 10], 1),
        ] {
            let refused = ordered(counts).unwrap_err().to_string();
            let expected = format!("row {at}: azimuth does not increase");
            assert!(refused.contains(&expected), "{refused}");
        }
        let refused = ordered(&[10, 5601]).unwrap_err().to_string();
        assert!(refused.contains("row 1: encoder count 5601"), "{refused}");
    }

    #[test]
    fn alternation_is_distinguished_from_validity() {
        assert!(chirps_alternate([0, 255, 0, 255, 0].into_iter()));
        assert!(!chirps_alternate([255; 6].into_iter()));
        assert!(!chirps_alternate([0; 6].into_iter()));
        assert!(!chirps_alternate(
            [255, 255, 0, 255, 255, 255, 0].into_iter()
        ));
        assert!(!chirps_alternate([0, 1, 0, 1].into_iter()));
        assert!(!chirps_alternate(std::iter::empty()));
    }

    #[test]
    fn smoothing_a_uniform_sweep_over_zero_changes_nothing() {
        let angle = |row: u16| f64::from((5000 + 14 * row) % 5600) * (TAU / 5600.0);
        let azimuth_rad: Vec<f32> = (0..300).map(|row| angle(row) as f32).collect();
        let stamp_ns = |row: i64| 1_547_131_046_000_000_000 + 625_000 * row;
        let uniform: Vec<i64> = (0..300).map(stamp_ns).collect();
        let mut smooth = uniform.clone();
        smooth_stamps(&azimuth_rad, &mut smooth);
        let apart = smooth.iter().zip(&uniform).map(|(a, b)| (a - b).abs());
        assert!(apart.max().unwrap() < 1_000);
    }
}
