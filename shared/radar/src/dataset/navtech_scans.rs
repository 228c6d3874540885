//! A folder of images with Navtech's columns, read by a format's profile: what Oxford, OORD, Boreas, MulRan (Oxford's form) and FoMo share.

use std::path::Path;

use super::Dataset;
use super::detect::Found;
use super::eccentricity;
use super::error::{OpenError, ReadError};
use super::first_look::{FirstLook, NamedBy};
use super::format::Format;
use super::image_size::ImageSize;
use super::images::Images;
use super::navtech_png::{self, ByteTen, METADATA_BYTES};
use super::options::{AzimuthSource, DatasetOptions};
use super::stamp;
use crate::scan::{MAX_AZIMUTHS, ScanLimits, ScanSlot, Sense, SweepGeometry};

/// How a scan's time follows from its rows'.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ScanTime {
    /// Half-way between the first and the last row.
    Halfway,
    /// The time of row `n / 2 - 1`.
    MiddleRow,
}

/// What tells one format from another.
#[derive(Clone, Debug)]
pub(crate) struct Profile {
    pub(crate) format: Format,
    pub(crate) range_resolution_m: f32,
    pub(crate) range_offset_m: f32,
    pub(crate) doppler_s: f32,
    pub(crate) azimuth_eccentricity_rad: f32,
    pub(crate) encoder_counts: u16,
    pub(crate) azimuth_source: AzimuthSource,
    pub(crate) scan_time: ScanTime,
    /// Rows' stamps come in bursts, and are replaced by a line over the azimuth.
    pub(crate) smooth_stamps: bool,
    pub(crate) byte_ten: ByteTen,
    pub(crate) named_by: NamedBy,
    pub(crate) stamp_meaning: &'static str,
}

impl Profile {
    fn with(mut self, options: &DatasetOptions) -> Self {
        self.range_resolution_m = options
            .range_resolution_m
            .unwrap_or(self.range_resolution_m);
        self.range_offset_m = options.range_offset_m.unwrap_or(self.range_offset_m);
        self.doppler_s = options.doppler_s.unwrap_or(self.doppler_s);
        self.azimuth_eccentricity_rad = options
            .azimuth_eccentricity_rad
            .unwrap_or(self.azimuth_eccentricity_rad);
        self.encoder_counts = options.encoder_counts.unwrap_or(self.encoder_counts);
        self.azimuth_source = options.azimuth_source.unwrap_or(self.azimuth_source);
        self
    }
}

/// The scans of such a folder. Images decode in place: a scan's rows keep their 11 bytes of metadata.
#[derive(Debug)]
pub(crate) struct NavtechScans {
    images: Images,
    profile: Profile,
    period_ns: i64,
    notes: Vec<String>,
}

impl NavtechScans {
    /// `profile` holds the format's defaults, for which it may look at the first image; `options` go over them.
    pub(crate) fn open(
        found: Found,
        options: &DatasetOptions,
        profile: impl FnOnce(Option<&FirstLook>) -> Profile,
    ) -> Result<Self, OpenError> {
        let Found {
            format,
            mut images,
            mut notes,
            ..
        } = found;
        check_shape(&images, format)?;
        let look = FirstLook::take(&mut images);
        let profile = profile(look.as_ref()).with(options);
        notes.extend(look.iter().flat_map(|look| observations(look, &profile)));
        let period_ns =
            stamp::usual_interval((0..images.len()).filter_map(|i| images.name_stamp_ns(i)));
        Ok(Self {
            images,
            profile,
            period_ns,
            notes,
        })
    }

    fn check_slot(&self, slot: &ScanSlot<'_>) -> Result<(), ReadError> {
        let rows = self.images.size.height;
        check_room("azimuths", rows, slot.azimuth_rad.len())?;
        check_room("stamps", rows, slot.stamp_ns.len())?;
        check_room("flags", rows, slot.flags.len())
    }

    fn scan_time_ns(&self, stamp_ns: &[i64]) -> i64 {
        let n = stamp_ns.len();
        match self.profile.scan_time {
            ScanTime::Halfway => stamp::middle(stamp_ns[0], stamp_ns[n - 1]),
            ScanTime::MiddleRow => stamp_ns[(n / 2).saturating_sub(1)],
        }
    }

    /// Time from this scan's name to the next one's, where that can be one turn; else the usual one.
    fn interval_ns(&self, index: usize) -> i64 {
        let name = |i: usize| self.images.name_stamp_ns(i);
        let next = index
            .checked_add(1)
            .and_then(name)
            .zip(name(index))
            .map(|(b, a)| b - a);
        next.filter(|ns| (ns - self.period_ns).abs() < self.period_ns / 5)
            .unwrap_or(self.period_ns)
    }
}

pub(crate) fn check_room(
    what: &'static str,
    needed: usize,
    actual: usize,
) -> Result<(), ReadError> {
    if actual < needed {
        return Err(ReadError::SlotTooSmall {
            what,
            needed,
            actual,
        });
    }
    Ok(())
}

fn check_shape(images: &Images, format: Format) -> Result<(), OpenError> {
    let ImageSize { width, height } = images.size;
    let reason = if width <= METADATA_BYTES {
        format!("it needs {METADATA_BYTES} columns of metadata before the powers")
    } else if !(2..=MAX_AZIMUTHS).contains(&height) {
        format!(
            "it needs a row for each azimuth, 2 to {MAX_AZIMUTHS} of them; it may lie on its side"
        )
    } else {
        return Ok(());
    };
    Err(OpenError::WrongImage {
        path: images.file(0).to_owned(),
        actual: images.size,
        format,
        reason,
    })
}

/// What is worth saying about the first image.
fn observations(look: &FirstLook, profile: &Profile) -> Vec<String> {
    let named = look.named_by().filter(|by| *by != profile.named_by).map(|by| {
        let (format, usual) = (profile.format, profile.named_by.words());
        format!(
            "The files are named by {}, while {format} files are named by {usual}: the format may be another one.",
            by.words()
        )
    });
    [
        note_bursts(look, profile),
        note_byte_ten(look, profile),
        note_encoder(look, profile),
        named,
    ]
    .into_iter()
    .flatten()
    .collect()
}

fn note_bursts(look: &FirstLook, profile: &Profile) -> Option<String> {
    let (least, most, mean) = look.row_intervals_ns()?;
    let made = if profile.smooth_stamps {
        "replaced by a line over the azimuth"
    } else {
        "taken as they are"
    };
    (most > 4 * mean.max(1)).then(|| {
        format!(
            "Row stamps come in bursts ({} to {} us apart, {} us on average), as packets are received: they are {made}.",
            least / 1000,
            most / 1000,
            mean / 1000
        )
    })
}

fn note_byte_ten(look: &FirstLook, profile: &Profile) -> Option<String> {
    if look.chirps_alternate() {
        return Some("Byte 10 alternates from row to row: it is the chirp's direction (255 up, 0 down), not validity; no row is dropped for it.".to_owned());
    }
    (look.byte_ten_is_zero() && profile.byte_ten == ByteTen::Unused).then(|| {
        "Byte 10 is 0 in every row: it says nothing about validity or chirps, and all rows count as measured."
            .to_owned()
    })
}

fn note_encoder(look: &FirstLook, profile: &Profile) -> Option<String> {
    if profile.azimuth_source == AzimuthSource::Uniform {
        return Some(
            "Azimuths are taken as even steps from straight ahead; the encoder columns are not used.".to_owned(),
        );
    }
    let counts = profile.encoder_counts;
    let (step, seam) = look.encoder_step(counts)?;
    (step != seam).then(|| {
        let even = i32::from(counts) + i32::from(step) - i32::from(seam);
        format!(
            "The encoder steps by {step} counts a row and by {seam} across the seam, with {counts} counts a turn: \
             with `encoder_counts = {even}` the seam would be even, and the azimuths differ by up to {:.2} deg.",
            360.0 * (f64::from(even) / f64::from(counts) - 1.0).abs()
        )
    })
}

impl Dataset for NavtechScans {
    fn format(&self) -> Format {
        self.profile.format
    }

    fn len(&self) -> usize {
        self.images.len()
    }

    fn limits(&self) -> ScanLimits {
        ScanLimits {
            bytes: self.images.size.bytes(),
            azimuths: self.images.size.height,
        }
    }

    fn image_size(&self) -> ImageSize {
        self.images.size
    }

    fn file(&self, index: usize) -> &Path {
        self.images.file(index)
    }

    fn nominal_stamp_ns(&self, index: usize) -> Option<i64> {
        let name = self.images.name_stamp_ns(index)?;
        let rows = self.images.size.height as i64;
        let half_sweep = self.interval_ns(index) * (rows - 1) / (2 * rows);
        Some(match self.profile.named_by {
            NamedBy::Start => name + half_sweep,
            NamedBy::Middle => name,
            NamedBy::End => name - half_sweep,
        })
    }

    fn logged_stamp_ns(&self, index: usize) -> Option<i64> {
        self.images.name_stamp_ns(index)
    }

    fn stamp_meaning(&self) -> &'static str {
        self.profile.stamp_meaning
    }

    fn encoder_counts(&self) -> Option<u16> {
        (self.profile.azimuth_source == AzimuthSource::Encoder)
            .then_some(self.profile.encoder_counts)
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }

    fn read(&mut self, index: usize, slot: ScanSlot<'_>) -> Result<SweepGeometry, ReadError> {
        self.check_slot(&slot)?;
        self.images.decode(index, slot.bytes)?;
        let (size, path, profile) = (self.images.size, self.images.file(index), &self.profile);
        let (azimuth_rad, stamp_ns) = (
            &mut slot.azimuth_rad[..size.height],
            &mut slot.stamp_ns[..size.height],
        );
        navtech_png::fill_azimuths(
            path,
            slot.bytes,
            size,
            profile.azimuth_source,
            profile.encoder_counts,
            azimuth_rad,
        )?;
        navtech_png::fill_stamps(path, slot.bytes, size, stamp_ns)?;
        navtech_png::fill_flags(slot.bytes, size, profile.byte_ten, slot.flags);
        let scan_ns = self.scan_time_ns(stamp_ns);
        if profile.smooth_stamps {
            navtech_png::smooth_stamps(azimuth_rad, stamp_ns);
        }
        eccentricity::correct(azimuth_rad, profile.azimuth_eccentricity_rad);
        Ok(SweepGeometry {
            azimuths: size.height,
            bins: size.width - METADATA_BYTES,
            stride: size.width,
            first_byte: METADATA_BYTES,
            range_resolution_m: profile.range_resolution_m,
            range_offset_m: profile.range_offset_m,
            doppler_s: profile.doppler_s,
            sense: Sense::Clockwise,
            stamp_ns: scan_ns,
        })
    }
}
