//! Reader of transposed images without metadata: rows are range (nearest first), columns azimuth
//! from straight ahead.

use std::path::PathBuf;

use gyre_geometry::scan::{MAX_AZIMUTHS, ScanLimits, ScanSlot, SweepGeometry, flag};

use super::{
    Dataset, Properties,
    detect::Found,
    encoder::correct_eccentricity,
    error::{OpenError, ReadError},
    images::Images,
    navtech_png::fill_uniform,
    options::{DatasetOptions, LostAzimuthOption},
    profiles::{MULRAN_RESOLUTION_M, Profile},
    stamp,
};

/// Side of the blocks of the transposition, pixels: a cache line.
const BLOCK: usize = 64;
/// Least correlation of a stale row with the same row of the image before. It is 0.93 to 0.97 for
/// stale rows that were compressed again, and mostly below 0.75 for measured rows.
const STALE: f64 = 0.85;
/// Share of the bins, the nearest, that are left out: the echoes of the vehicle itself are the same
/// in each turn.
const NEAR: f64 = 0.05;
const MULRAN_STAMPS: &str = "Files are named by the time of the last column; columns are spread uniformly over a turn, which is the time since \
                      the previous file, and the time of a scan is the mean of its columns'.";

#[derive(Clone, Copy, Debug)]
pub(crate) struct Turn {
    pub(crate) start_ns: i64,
    pub(crate) period_ns: i64,
    /// The stamp as logged; if that is wrong, of a host that is never late.
    pub(crate) logged_ns: i64,
}

/// The scans of a folder, with scratch memory for the transposition. Images that are wider than
/// high are not transposed.
pub(crate) struct TransposedScans {
    pub(crate) images: Images,
    /// The caller sets the period with the turns.
    pub(crate) properties: Properties,
    /// One per image.
    pub(crate) turns: Vec<Turn>,
    /// The azimuth of the first column, steps clockwise from ahead. The caller sets it if it is not
    /// 0.
    pub(crate) first_azimuth: f64,
    profile: Profile,
    scratch: Vec<u8>,
    /// Without angles, only stale rows show that the host has lost azimuths; `None`: they are
    /// ignored.
    pub(crate) stale: Option<StaleRows>,
}

impl TransposedScans {
    /// `metres_per_bin` returns the range resolution of the format from the number of range bins.
    /// The caller adds the turns.
    pub(crate) fn open(
        found: Found,
        options: &DatasetOptions,
        stamp_meaning: &'static str,
        metres_per_bin: impl FnOnce(usize) -> f32,
    ) -> Result<Self, OpenError> {
        let Found {
            format,
            images,
            notes,
            ..
        } = found;
        options.check_without_encoder(format)?;
        let size = images.size;
        let (azimuths, bins) = (size.height.min(size.width), size.height.max(size.width));
        if !(2..=MAX_AZIMUTHS).contains(&azimuths) {
            let reason = format!("it requires 2 to {MAX_AZIMUTHS} azimuths along its shorter side");
            return Err(images.wrong(format, &reason));
        }
        let mut scans = Self {
            properties: Properties {
                limits: ScanLimits {
                    bytes: size.bytes(),
                    azimuths,
                },
                is_transposed: size.height > size.width,
                notes,
                ..Properties::of(format, images.len(), size, stamp_meaning)
            },
            images,
            turns: Vec::new(),
            first_azimuth: 0.0,
            profile: Profile::without_rows(metres_per_bin(bins), options),
            scratch: Vec::new(),
            stale: (options.lost_azimuths != Some(LostAzimuthOption::Ignore))
                .then(StaleRows::default),
        };
        if scans.is_transposed() {
            scans.scratch = vec![0; size.bytes()];
            scans.properties.notes.push(format!(
                "Images are transposed ({} rows of range x {} columns of azimuth): they are transposed back when read.",
                size.height, size.width
            ));
        }
        Ok(scans)
    }

    pub(crate) fn azimuths(&self) -> usize {
        self.limits().azimuths
    }

    /// Decodes an image, azimuth x range bin.
    fn decode(&mut self, index: usize, into: &mut [u8]) -> Result<(), ReadError> {
        let rows = self.images.size.height;
        if !self.is_transposed() {
            return self.images.decode(index, rows..=rows, into).map(|_| ());
        }
        self.images.decode(index, rows..=rows, &mut self.scratch)?;
        transpose(&self.scratch, self.azimuths(), into);
        Ok(())
    }

    fn remember(&mut self, index: usize, image: Option<&[u8]>) {
        if let Some(stale) = &mut self.stale {
            stale.remember(index, image.unwrap_or_default());
        }
    }

    fn stamp_ns(&self, turn: &Turn) -> i64 {
        let n = self.azimuths() as i64;
        turn.start_ns + turn.period_ns * (n - 1) / (2 * n)
    }
}

impl Dataset for TransposedScans {
    fn properties(&self) -> &Properties {
        &self.properties
    }

    fn files(&self) -> &[PathBuf] {
        &self.images.files
    }

    fn nominal_stamp_ns(&self, index: usize) -> Option<i64> {
        self.turns.get(index).map(|turn| self.stamp_ns(turn))
    }

    fn logged_stamp_ns(&self, index: usize) -> Option<i64> {
        self.turns.get(index).map(|turn| turn.logged_ns)
    }

    fn read(&mut self, index: usize, slot: ScanSlot<'_>) -> Result<SweepGeometry, ReadError> {
        let turn = *self.turns.get(index).ok_or(ReadError::NoSuchScan {
            index,
            len: self.len(),
        })?;
        let azimuths = self.azimuths();
        let bins = self.images.size.bytes() / azimuths;
        let bytes = &mut slot.bytes[..azimuths * bins];
        // No image is before the first one.
        let before = index.checked_sub(1);
        // Before the image, since it is decoded into the same scratch memory.
        if let Some(before) = before
            && self.stale.as_ref().is_some_and(|stale| !stale.has(before))
        {
            match self.decode(before, bytes) {
                Ok(()) => self.remember(before, Some(bytes)),
                // The file may come back, as with this one.
                Err(ReadError::Io { .. }) => {}
                Err(_) => self.remember(before, None),
            }
        }
        self.decode(index, bytes)?;
        let has_before = |stale: &&StaleRows| before.is_some_and(|before| stale.has(before));
        let stale = self.stale.as_ref().filter(has_before);
        let lost = stale.map_or(0, |stale| stale.count(bytes, bins));
        self.remember(index, Some(bytes));
        let azimuth_rad = &mut slot.azimuth_rad[..azimuths];
        fill_uniform(azimuth_rad, self.first_azimuth);
        correct_eccentricity(azimuth_rad, self.profile.azimuth_eccentricity_rad);
        let assumed = self.stale.as_ref().map_or(0, |_| flag::ASSUMED);
        let (measured, stale) = slot.flags[..azimuths].split_at_mut(azimuths - lost);
        measured.fill(flag::MEASURED | assumed);
        stale.fill(flag::STALE | assumed);
        for (column, stamp) in slot.stamp_ns[..azimuths].iter_mut().enumerate() {
            *stamp = turn.start_ns + turn.period_ns * column as i64 / azimuths as i64;
        }
        let scan_ns = self.stamp_ns(&turn);
        Ok(self.profile.geometry(azimuths, [0, bins], scan_ns))
    }
}

/// Opens MulRan as recorded: `sensor_data/radar/polar/<ns>.png`, 3360 rows of range x 400 columns
/// of azimuth without metadata, named by the last row's stamp.
///
/// Column k is row k of the form of Oxford, where the encoder gives 7, 21, ..., 5593 of 5600 counts
/// (KAIST03): the middle of the k-th of 400 equal parts of the turn.
pub(crate) fn open_mulran(
    found: Found,
    options: &DatasetOptions,
) -> Result<TransposedScans, OpenError> {
    let mut scans = TransposedScans::open(found, options, MULRAN_STAMPS, |_| MULRAN_RESOLUTION_M)?;
    scans.first_azimuth = 0.5;
    let ends_ns = (0..scans.images.len()).map(|index| end_ns(&scans.images, index));
    let ends_ns = ends_ns.collect::<Result<Vec<_>, _>>()?;
    let turn_ns = stamp::turn_ns(ends_ns.iter().copied()).unwrap_or(stamp::DEFAULT_TURN_NS);
    let azimuths = scans.azimuths() as i64;
    let turn = |(index, &end_ns): (usize, &i64)| {
        let interval_ns = index.checked_sub(1).map(|before| end_ns - ends_ns[before]);
        let period_ns = interval_ns.filter(|ns| (ns - turn_ns).abs() < turn_ns / 5);
        let period_ns = period_ns.unwrap_or(turn_ns);
        Turn {
            start_ns: end_ns - period_ns * (azimuths - 1) / azimuths,
            period_ns,
            logged_ns: end_ns,
        }
    };
    scans.properties.period_ns = turn_ns;
    scans.turns = ends_ns.iter().enumerate().map(turn).collect();
    Ok(scans)
}

fn end_ns(images: &Images, index: usize) -> Result<i64, OpenError> {
    images.name_stamp_ns(index).ok_or_else(|| {
        let reason = "a MulRan image is named by its time in ns, of the years 2015 to 2040";
        let remedy = "rename it, or set the `format` that it is of";
        OpenError::unknown_layout(images.file(index), reason, remedy)
    })
}

/// `to[column][row] = from[row][column]`, for `from` of `columns` columns and `to` of the same
/// size.
fn transpose(from: &[u8], columns: usize, to: &mut [u8]) {
    let rows = from.len() / columns;
    for top in (0..rows).step_by(BLOCK) {
        let bottom = (top + BLOCK).min(rows);
        for left in (0..columns).step_by(BLOCK) {
            for column in left..(left + BLOCK).min(columns) {
                let line = &mut to[column * rows + top..column * rows + bottom];
                for (row, into) in (top..bottom).zip(line) {
                    *into = from[row * columns + column];
                }
            }
        }
    }
}

/// Stale rows: the last rows of an image, if they still contain rows of the image before. A host
/// that loses azimuths of a turn fills so many rows less.
#[derive(Debug, Default)]
pub(crate) struct StaleRows {
    of: Option<usize>,
    /// The rows of that image; empty if it cannot be read.
    rows: Vec<u8>,
    is_compressed: bool,
}

impl StaleRows {
    /// Expects stale rows that differ a little, because the images had a lossy compression.
    /// Otherwise stale rows are bitwise equal, so that measured rows of a standing radar do not
    /// count as stale.
    pub fn of_compressed(self) -> Self {
        Self {
            is_compressed: true,
            ..self
        }
    }

    pub fn has(&self, index: usize) -> bool {
        self.of == Some(index)
    }

    pub fn remember(&mut self, index: usize, image: &[u8]) {
        self.of = Some(index);
        self.rows.clear();
        self.rows.extend_from_slice(image);
    }

    /// Returns the number of stale rows at the end of an image of the same shape; 0 if all are, as
    /// where an image was written twice.
    pub fn count(&self, image: &[u8], bins: usize) -> usize {
        let near = (bins as f64 * NEAR) as usize;
        let rows = image.chunks_exact(bins).rev();
        let before = self.rows.chunks_exact(bins).rev();
        let is_stale = |(row, before): &(&[u8], &[u8])| {
            (self.is_compressed || row == before)
                && correlation(&row[near..], &before[near..]) > STALE
        };
        let stale = rows.zip(before).take_while(is_stale).count();
        if stale * bins < image.len() { stale } else { 0 }
    }
}

/// Pearson's correlation; 0 where a row is uniform.
fn correlation(a: &[u8], b: &[u8]) -> f64 {
    let mean = |row: &[u8]| row.iter().map(|p| f64::from(*p)).sum::<f64>() / row.len() as f64;
    let (mean_a, mean_b) = (mean(a), mean(b));
    let mut sums = [0.0; 3];
    for (a, b) in a.iter().zip(b) {
        let (a, b) = (f64::from(*a) - mean_a, f64::from(*b) - mean_b);
        for (sum, product) in sums.iter_mut().zip([a * b, a * a, b * b]) {
            *sum += product;
        }
    }
    let [both, of_a, of_b] = sums;
    match of_a * of_b > 0.0 {
        true => both / (of_a * of_b).sqrt(),
        false => 0.0,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const BINS: usize = 200;

    fn image(seed: u64) -> Vec<u8> {
        let noise = |i: u64| (i + seed * 7919).wrapping_mul(0x9E37_79B9_7F4A_7C15) >> 40;
        (0..20 * BINS as u64)
            .map(|i| (noise(i) % 200) as u8)
            .collect()
    }

    #[test]
    fn rows_at_the_end_that_are_those_of_the_image_before_as_compressed_anew_are_stale() {
        let (before, lost) = (image(1), 3);
        let mut now = image(2);
        for (power, stale) in now.iter_mut().zip(&before).skip((20 - lost) * BINS) {
            *power = stale.saturating_add(stale % 7);
        }
        for (mut rows, expected) in [
            (StaleRows::default().of_compressed(), lost),
            (StaleRows::default(), 0),
        ] {
            rows.remember(4, &before);
            assert_eq!(rows.count(&now, BINS), expected);
        }
        let mut rows = StaleRows::default();
        rows.remember(0, &before);
        assert_eq!(rows.count(&before, BINS), 0, "written twice");
    }

    #[test]
    fn uniform_rows_are_not_stale() {
        let dark = vec![0; 20 * BINS];
        let mut rows = StaleRows::default();
        rows.remember(0, &dark);
        assert_eq!(rows.count(&dark, BINS), 0);
    }
}
