//! Reader of images with Navtech metadata columns, parameterised by a profile per format: Oxford,
//! OORD, Boreas, MulRan (Oxford format) and FoMo.

use std::{ops::RangeInclusive, path::PathBuf};

use gyre_geometry::{
    MAX_INTERVAL_NS,
    scan::{MAX_AZIMUTHS, ScanLimits, ScanSlot, SweepGeometry},
};

use super::{
    Dataset, Properties,
    detect::Found,
    encoder::{EncoderTurn, FIRST_TURNS, correct_eccentricity, encoder_counts},
    error::{OpenError, ReadError},
    first_image::{FirstImage, NamedBy, turn_of},
    format::Format,
    images::Images,
    navtech_png::{self, ByteTen, METADATA_BYTES},
    options::{AzimuthSource, DatasetOptions},
    png_image::ImageSize,
    profiles::{Profile, ScanTime},
    row_order, stamp,
};

/// The scans of a folder. Images decode in place: the rows of a scan keep their 11 bytes of
/// metadata.
pub(crate) struct NavtechScans {
    images: Images,
    properties: Properties,
    profile: Profile,
    max_sweep_ns: i64,
    /// True if the names of the files are times of their sweeps.
    named_by_time: bool,
    /// Times of the first rows, ns, if the names of the files are not times of their sweeps.
    starts_ns: Option<Vec<i64>>,
}

/// Longest sweep where the period is unknown, ns. The slowest scanning radars turn once in 2 s.
const MAX_SWEEP_NS: i64 = 5 * stamp::SECOND_NS;
/// Longest sweep in periods: the stamps of rows come late where the host was busy.
const MAX_SWEEP_PERIODS: i64 = 2;

impl NavtechScans {
    /// `profile` has the defaults of the format; `options` take precedence.
    pub(crate) fn open(
        found: Found,
        options: &DatasetOptions,
        profile: Profile,
    ) -> Result<Self, OpenError> {
        let (format, mut images, mut notes) = (found.format, found.images, found.notes);
        check_shape(&images, format)?;
        let mut first_image = FirstImage::read(&mut images)?;
        let order = |image| row_order::order(&mut images, image);
        let (mut starts_ns, mut meaning) = (None, profile.stamp_meaning);
        if let Some((starts, more)) = first_image.as_ref().and_then(order) {
            first_image = FirstImage::read(&mut images)?;
            (starts_ns, meaning) = (Some(starts), profile.scan_time.of_rows());
            notes.extend(more);
        }
        let named_by = first_image.as_ref().and_then(FirstImage::named_by);
        let mut scans = Self {
            properties: Properties {
                limits: ScanLimits {
                    bytes: images.size.width * images.max_rows,
                    azimuths: images.max_rows,
                },
                notes,
                ..Properties::of(format, images.len(), images.size, meaning)
            },
            profile: profile.with(format, first_image.as_ref(), options),
            max_sweep_ns: MAX_SWEEP_NS,
            named_by_time: named_by.is_some(),
            starts_ns,
            images,
        };
        let logged = (0..scans.images.len()).filter_map(|index| scans.logged_stamp_ns(index));
        let turn_ns = stamp::turn_ns(logged);
        if let Some(turn_ns) = turn_ns {
            scans.properties.period_ns = turn_ns;
            scans.max_sweep_ns = MAX_SWEEP_PERIODS * turn_ns;
        }
        if let Some(image) = &first_image {
            if scans.has_encoder() && options.encoder_counts.is_none() {
                scans.find_encoder(image, turn_ns);
            }
            let notes = observations(image, format, &scans.profile);
            scans.properties.notes.extend(notes);
        }
        let counts = scans.profile.encoder_counts;
        scans.properties.encoder_counts = scans.has_encoder().then_some(counts);
        Ok(scans)
    }

    /// Takes the size of the encoder that the first images show, unless it is the usual one, or the
    /// first image took less or more than a turn.
    fn find_encoder(&mut self, image: &FirstImage, turn_ns: Option<i64>) {
        let usual = self.profile.encoder_counts;
        let by_first = encoder_counts(&[image.turn()], turn_ns, usual);
        if by_first.is_none_or(|counts| counts == usual) {
            return;
        }
        let found = encoder_counts(&self.first_turns(), turn_ns, usual);
        if let Some(found) = found.filter(|found| *found != usual) {
            self.profile.encoder_counts = found;
            self.properties.notes.push(format!(
                "The encoder has {found} counts per turn, not {usual}: with these the step from the last row to the first is as the others."
            ));
        }
    }

    fn first_turns(&mut self) -> Vec<EncoderTurn> {
        let rows = self.images.accepted_rows();
        let mut pixels = vec![0; self.images.size.width * rows.end()];
        let turn = |index| {
            let decoded = self.images.decode(index, rows.clone(), &mut pixels);
            let rows: Vec<_> = navtech_png::rows(&pixels, decoded.ok()?).collect();
            Some(turn_of(&rows))
        };
        (0..FIRST_TURNS).filter_map(turn).collect()
    }

    /// The numbers of rows that are read: azimuths may have been lost. Where azimuths are taken as
    /// even, only a few may.
    fn accepted_rows(&self) -> RangeInclusive<usize> {
        let (rows, usual) = (self.images.accepted_rows(), self.images.size.height);
        match self.has_encoder() {
            true => rows,
            false => usual - usual / 16..=*rows.end(),
        }
    }

    fn has_encoder(&self) -> bool {
        self.profile.azimuth_source == AzimuthSource::Encoder
    }

    fn scan_time_ns(&self, stamp_ns: &[i64]) -> i64 {
        let n = stamp_ns.len();
        match self.profile.scan_time {
            ScanTime::Halfway => stamp::middle_ns(stamp_ns[0], stamp_ns[n - 1]),
            ScanTime::MiddleRow => stamp_ns[(n / 2).saturating_sub(1)],
        }
    }

    /// Rejects a scan that is far from the time in its file's name, if that is how the files are
    /// named.
    fn check_name(&self, index: usize, scan_ns: i64) -> Result<(), ReadError> {
        let named_ns = self.nominal_stamp_ns(index).filter(|_| self.named_by_time);
        let apart_ns = named_ns.map_or(0, |named_ns| scan_ns - named_ns);
        if apart_ns.abs() <= MAX_INTERVAL_NS {
            return Ok(());
        }
        let apart_s = apart_ns as f64 * 1e-9;
        let fault = format!(
            ": stamps of its rows are {apart_s:.1} s from the time in its name, which other files agree with: the clock was set, or the file has another scan's name"
        );
        Err(ReadError::image(self.images.file(index), fault))
    }

    /// Time between the logged times of this file and the next, ns, if that can be one turn;
    /// otherwise the period.
    fn interval_ns(&self, index: usize) -> i64 {
        let stamp_ns = |index| self.logged_stamp_ns(index);
        let next_ns = index.checked_add(1).and_then(stamp_ns);
        let interval_ns = next_ns.zip(stamp_ns(index)).map(|(b, a)| b - a);
        let period_ns = self.period_ns();
        let is_turn = |ns: &i64| (ns - period_ns).abs() < period_ns / 5;
        interval_ns.filter(is_turn).unwrap_or(period_ns)
    }
}

fn check_shape(images: &Images, format: Format) -> Result<(), OpenError> {
    let ImageSize { width, height } = images.size;
    let reason = if width <= METADATA_BYTES {
        format!("it requires {METADATA_BYTES} columns of metadata before the powers")
    } else if !(2..=MAX_AZIMUTHS).contains(&height) {
        format!("it requires one row per azimuth, 2 to {MAX_AZIMUTHS}; the image may be transposed")
    } else {
        return Ok(());
    };
    Err(images.wrong(format, &reason))
}

/// Sentences on the properties of the first image.
fn observations(image: &FirstImage, format: Format, profile: &Profile) -> Vec<String> {
    let mut notes: Vec<String> = note_bursts(image, profile).into_iter().collect();
    if image.chirps_alternate() {
        notes.push("Byte 10 alternates from row to row: it is the direction of the chirp (255 up, 0 down), not validity; no row is dropped.".to_owned());
    } else if image.byte_ten_is_zero() && profile.byte_ten == ByteTen::Unused {
        notes.push("Byte 10 is 0 in every row: it gives neither validity nor chirps, and all rows count as measured.".to_owned());
    }
    if profile.azimuth_source == AzimuthSource::Uniform {
        notes.push("Azimuths are taken as uniformly spaced from straight ahead; the encoder columns are not used.".to_owned());
    }
    if let Some(by) = image.named_by().filter(|by| *by != profile.named_by) {
        let (named, expected) = (by.description(), profile.named_by.description());
        notes.push(format!(
            "The files are named by {named}, but {format} files by {expected}: the format may be a different one."
        ));
    }
    notes
}

fn note_bursts(image: &FirstImage, profile: &Profile) -> Option<String> {
    let (min, max, mean) = image.row_intervals_ns()?;
    let handling = match profile.smooth_stamps {
        true => "replaced by a linear fit over the azimuth",
        false => "used as they are",
    };
    let [min_us, max_us, mean_us] = [min, max, mean].map(|ns| ns / 1000);
    (max > 4 * mean.max(1)).then(|| {
        format!(
            "Row stamps come in bursts ({min_us} to {max_us} us apart, {mean_us} us on average), as packets are received: they are {handling}."
        )
    })
}

impl Dataset for NavtechScans {
    fn properties(&self) -> &Properties {
        &self.properties
    }

    fn files(&self) -> &[PathBuf] {
        &self.images.files
    }

    fn nominal_stamp_ns(&self, index: usize) -> Option<i64> {
        let logged_ns = self.logged_stamp_ns(index)?;
        let rows = self.images.size.height as i64;
        let half_sweep = self.interval_ns(index) * (rows - 1) / (2 * rows);
        Some(match (&self.starts_ns, self.profile.named_by) {
            (Some(_), _) | (None, NamedBy::Start) => logged_ns + half_sweep,
            (None, NamedBy::Middle) => logged_ns,
            (None, NamedBy::End) => logged_ns - half_sweep,
        })
    }

    fn logged_stamp_ns(&self, index: usize) -> Option<i64> {
        match &self.starts_ns {
            Some(starts_ns) => starts_ns.get(index).copied(),
            None => self.images.name_stamp_ns(index),
        }
    }

    fn read(&mut self, index: usize, slot: ScanSlot<'_>) -> Result<SweepGeometry, ReadError> {
        let rows = self.accepted_rows();
        let size = self.images.decode(index, rows, slot.bytes)?;
        let (path, profile) = (self.images.file(index), &self.profile);
        let azimuth_rad = &mut slot.azimuth_rad[..size.height];
        let stamp_ns = &mut slot.stamp_ns[..size.height];
        match self.has_encoder() {
            true => {
                let counts = profile.encoder_counts;
                navtech_png::fill_azimuths(path, slot.bytes, size, counts, azimuth_rad)?;
            }
            false => navtech_png::fill_uniform(azimuth_rad, 0.0),
        }
        navtech_png::fill_stamps(path, slot.bytes, size, self.max_sweep_ns, stamp_ns)?;
        navtech_png::fill_flags(slot.bytes, size, profile.byte_ten, slot.flags);
        let scan_ns = self.scan_time_ns(stamp_ns);
        self.check_name(index, scan_ns)?;
        if profile.smooth_stamps {
            navtech_png::smooth_stamps(azimuth_rad, stamp_ns);
        }
        correct_eccentricity(azimuth_rad, profile.azimuth_eccentricity_rad);
        let bytes = [METADATA_BYTES, size.width - METADATA_BYTES];
        Ok(profile.geometry(size.height, bytes, scan_ns))
    }
}
