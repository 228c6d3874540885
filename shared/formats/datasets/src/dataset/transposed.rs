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
    profiles::Profile,
    stale::StaleRows,
};

/// Side of the blocks of the transposition, pixels: a cache line.
const BLOCK: usize = 64;

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
