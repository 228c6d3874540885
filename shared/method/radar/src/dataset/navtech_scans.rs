//! Reader of images with Navtech metadata columns, parameterised by a profile per format: Oxford,
//! OORD, Boreas, MulRan (Oxford format) and FoMo.

use super::Dataset;
use super::detect::Found;
use super::eccentricity;
use super::error::{OpenError, ReadError};
use super::file_list::FileList;
use super::first_image::{FirstImage, NamedBy};
use super::format::Format;
use super::image_size::ImageSize;
use super::images::Images;
use super::navtech_png::{self, ByteTen, METADATA_BYTES};
use super::options::{AzimuthSource, DatasetOptions};
use super::stamp;
use crate::chain::MAX_INTERVAL_NS;
use crate::scan::{MAX_AZIMUTHS, ScanLimits, ScanSlot, Sense, SweepGeometry};

/// The definition of the time of a scan.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum ScanTime {
    /// The mean of the first and last row's stamps.
    Halfway,
    /// The stamp of row `n / 2 - 1`.
    MiddleRow,
}

/// The parameters of a format.
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
    /// True if row stamps come in bursts, and are replaced by a linear fit over the azimuth.
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

/// The scans of a folder. Images decode in place: the rows of a scan keep their 11 bytes of
/// metadata.
#[derive(Debug)]
pub(crate) struct NavtechScans {
    images: Images,
    profile: Profile,
    period_ns: i64,
    /// The longest plausible sweep.
    max_sweep_ns: i64,
    /// True if the names of the files are times of their sweeps.
    named_by_time: bool,
    notes: Vec<String>,
}

/// Longest sweep where the period is unknown, ns. The slowest scanning radars turn once in 2 s.
const MAX_SWEEP_NS: i64 = 5 * stamp::SECOND_NS;
/// Longest sweep in periods: the stamps of rows come late where the host was busy.
const MAX_SWEEP_PERIODS: i64 = 2;

impl NavtechScans {
    /// `profile` returns the defaults of the format, which may depend on the first image; `options`
    /// take precedence.
    pub(crate) fn open(
        found: Found,
        options: &DatasetOptions,
        profile: impl FnOnce(Option<&FirstImage>) -> Profile,
    ) -> Result<Self, OpenError> {
        let Found {
            format,
            mut images,
            mut notes,
            ..
        } = found;
        check_shape(&images, format)?;
        let first_image = FirstImage::read(&mut images)?;
        let profile = profile(first_image.as_ref()).with(options);
        notes.extend(
            first_image
                .iter()
                .flat_map(|image| observations(image, &profile)),
        );
        let period_ns = stamp::turn_ns((0..images.len()).filter_map(|i| images.name_stamp_ns(i)));
        Ok(Self {
            images,
            profile,
            period_ns: period_ns.unwrap_or(stamp::DEFAULT_TURN_NS),
            max_sweep_ns: period_ns.map_or(MAX_SWEEP_NS, |turn_ns| MAX_SWEEP_PERIODS * turn_ns),
            named_by_time: first_image.is_some_and(|image| image.named_by().is_some()),
            notes,
        })
    }

    fn check_slot(&self, slot: &ScanSlot<'_>) -> Result<(), ReadError> {
        let rows = self.images.size.height;
        check_capacity("azimuths", rows, slot.azimuth_rad.len())?;
        check_capacity("stamps", rows, slot.stamp_ns.len())?;
        check_capacity("flags", rows, slot.flags.len())
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
        match apart_ns.abs() <= MAX_INTERVAL_NS {
            true => Ok(()),
            false => Err(ReadError::NameTime {
                path: self.images.file(index).to_owned(),
                apart_s: apart_ns as f64 * 1e-9,
            }),
        }
    }

    /// Time between the names of this file and the next, ns, if that can be one turn; otherwise the
    /// period.
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

pub(crate) fn check_capacity(
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
        format!("it requires {METADATA_BYTES} columns of metadata before the powers")
    } else if !(2..=MAX_AZIMUTHS).contains(&height) {
        format!("it requires one row per azimuth, 2 to {MAX_AZIMUTHS}; the image may be transposed")
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

/// Observations on the first image.
fn observations(image: &FirstImage, profile: &Profile) -> Vec<String> {
    let named = image.named_by().filter(|by| *by != profile.named_by).map(|by| {
        let (format, expected) = (profile.format, profile.named_by.description());
        format!(
            "The files are named by {}, but {format} files by {expected}: the format may be another one.",
            by.description()
        )
    });
    [
        note_bursts(image, profile),
        note_byte_ten(image, profile),
        note_encoder(image, profile),
        named,
    ]
    .into_iter()
    .flatten()
    .collect()
}

fn note_bursts(image: &FirstImage, profile: &Profile) -> Option<String> {
    let (min, max, mean) = image.row_intervals_ns()?;
    let handling = if profile.smooth_stamps {
        "replaced by a linear fit over the azimuth"
    } else {
        "used as they are"
    };
    (max > 4 * mean.max(1)).then(|| {
        format!(
            "Row stamps come in bursts ({} to {} us apart, {} us on average), as packets are received: they are {handling}.",
            min / 1000,
            max / 1000,
            mean / 1000
        )
    })
}

fn note_byte_ten(image: &FirstImage, profile: &Profile) -> Option<String> {
    if image.chirps_alternate() {
        return Some("Byte 10 alternates from row to row: it is the direction of the chirp (255 up, 0 down), not validity; no row is dropped.".to_owned());
    }
    (image.byte_ten_is_zero() && profile.byte_ten == ByteTen::Unused).then(|| {
        "Byte 10 is 0 in every row: it gives neither validity nor chirps, and all rows count as measured."
            .to_owned()
    })
}

fn note_encoder(image: &FirstImage, profile: &Profile) -> Option<String> {
    if profile.azimuth_source == AzimuthSource::Uniform {
        return Some(
            "Azimuths are taken as uniformly spaced from straight ahead; the encoder columns are not used.".to_owned(),
        );
    }
    let counts = profile.encoder_counts;
    let (step, seam) = image.encoder_step(counts)?;
    (step != seam).then(|| {
        let uniform = i32::from(counts) + i32::from(step) - i32::from(seam);
        format!(
            "The encoder steps by {step} counts per row and by {seam} from the last row to the first, with {counts} counts per \
             turn: `encoder_counts = {uniform}` would make the steps equal, and change azimuths by up to {:.2} deg.",
            360.0 * (f64::from(uniform) / f64::from(counts) - 1.0).abs()
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

    fn files(&self) -> &FileList {
        self.images.files()
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

    fn period_ns(&self) -> i64 {
        self.period_ns
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
        navtech_png::fill_stamps(path, slot.bytes, size, self.max_sweep_ns, stamp_ns)?;
        navtech_png::fill_flags(slot.bytes, size, profile.byte_ten, slot.flags);
        let scan_ns = self.scan_time_ns(stamp_ns);
        self.check_name(index, scan_ns)?;
        if profile.smooth_stamps {
            navtech_png::smooth_stamps(azimuth_rad, stamp_ns);
        }
        eccentricity::correct_eccentricity(azimuth_rad, profile.azimuth_eccentricity_rad);
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
