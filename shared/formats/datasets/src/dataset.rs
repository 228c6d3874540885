//! Readers of radar recordings: one trait for all formats.

mod detect;
mod encoder;
mod error;
mod first_image;
mod format;
mod image_list;
mod images;
mod navtech_png;
mod navtech_scans;
mod options;
mod png_image;
mod profiles;
mod radiate;
mod row_order;
mod sensor_clock;
pub(crate) mod stamp;
mod transposed;

use std::{
    ops::Range,
    path::{Path, PathBuf},
};

use gyre_geometry::{
    OwnedScan,
    samples::{Logged, Sample, SampleKind},
    scan::{ScanLimits, ScanSlot, SweepGeometry},
};
use gyre_radar::{NoDoppler, check_chirps};

pub use detect::is_dataset;
pub(crate) use detect::is_folder_of_images;
pub use encoder::{EncoderTurn, FIRST_TURNS, correct_eccentricity, encoder_counts};
pub use error::{OpenError, ReadError};
pub use format::Format;
pub use images::ImageSource;
pub use options::{AzimuthSource, DatasetOptions, LostAzimuthOption, stored_options};
pub use png_image::ImageSize;
pub use radiate::frame_stamps;
pub use stamp::{DEFAULT_TURN_NS, middle_ns, parse_seconds, to_ns as stamp_to_ns, turn_ns};

/// The properties of a recording, which stay the same while it is open.
pub struct Properties {
    pub format: Format,
    /// Number of scans.
    pub len: usize,
    /// Memory that a scan needs, from the header of the first image. All images must have its size.
    pub limits: ScanLimits,
    /// Size of the images as stored.
    pub image_size: ImageSize,
    /// True if the images are stored as range x azimuth, and transposed by [`Dataset::read`].
    pub is_transposed: bool,
    /// Median time between two scans, ns.
    pub period_ns: i64,
    /// The definition of the stamps, and how the middle of the sweep is obtained: one sentence.
    pub stamp_meaning: &'static str,
    /// Encoder counts per turn, if azimuths come from an encoder.
    pub encoder_counts: Option<u16>,
    /// Observations of the reader when it opened the dataset, and how it handles them: whole
    /// sentences.
    pub notes: Vec<String>,
    /// The first place where the recording is damaged or ends too early, so that scans may be
    /// missing: a sentence without its full stop. `None` if all that was recorded is there.
    pub damage: Option<String>,
}

impl Properties {
    /// Returns the properties of so many images, azimuth x range, without an encoder.
    pub fn of(format: Format, len: usize, size: ImageSize, stamp_meaning: &'static str) -> Self {
        Self {
            format,
            len,
            limits: ScanLimits {
                bytes: size.bytes(),
                azimuths: size.height,
            },
            image_size: size,
            is_transposed: false,
            period_ns: DEFAULT_TURN_NS,
            stamp_meaning,
            encoder_counts: None,
            notes: Vec::new(),
            damage: None,
        }
    }
}

/// Methods that return the property of their name.
macro_rules! properties {
    ($($name:ident: $type:ty,)*) => {
        $(fn $name(&self) -> $type {
            self.properties().$name
        })*
    };
}

/// The scans of one recording, ordered by time.
///
/// A scan that cannot be read gives an error; the others stay readable.
pub trait Dataset: Send {
    fn properties(&self) -> &Properties;

    properties! {
        format: Format,
        len: usize,
        limits: ScanLimits,
        image_size: ImageSize,
        is_transposed: bool,
        period_ns: i64,
        stamp_meaning: &'static str,
        encoder_counts: Option<u16>,
    }

    fn notes(&self) -> &[String] {
        &self.properties().notes
    }

    fn damage(&self) -> Option<&str> {
        self.properties().damage.as_deref()
    }

    /// Index of the first scan that can be read; those before it are of another part of the drive.
    fn first(&self) -> usize {
        0
    }

    /// Indices of the scans that can be read.
    fn scans(&self) -> Range<usize> {
        self.first()..self.len()
    }

    /// Returns whether there is no scan; `open` rejects such a folder.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The files of the scans.
    fn files(&self) -> &[PathBuf];

    /// The file of a scan; an empty path past the end.
    fn file(&self, index: usize) -> &Path {
        let file = self.files().get(index);
        file.map_or(Path::new(""), PathBuf::as_path)
    }

    /// Time of a scan (the middle of the sweep on the sensor's clock), ns since 1970, as far as it
    /// is known without decoding.
    fn nominal_stamp_ns(&self, index: usize) -> Option<i64>;

    /// Time logged for a scan (in the file name or the list of stamps), ns since 1970.
    fn logged_stamp_ns(&self, index: usize) -> Option<i64> {
        self.nominal_stamp_ns(index)
    }

    /// Decodes a scan into `slot`, whose slices must be at least as long as [`Dataset::limits`].
    fn read(&mut self, index: usize, slot: ScanSlot<'_>) -> Result<SweepGeometry, ReadError>;

    /// Decodes a scan into memory of its own.
    fn scan(&mut self, index: usize) -> Result<OwnedScan, ReadError> {
        let mut scan = OwnedScan::with_limits(self.limits());
        scan.geometry = self.read(index, scan.slot())?;
        Ok(scan)
    }

    /// Reads the samples of another sensor that the recording itself has, on the topic of this
    /// name, else on the only one: in the sensor's own axes and on its own clock, in the order of
    /// the recording. `None` without one.
    fn logged(&mut self, of: SampleKind, topic: Option<&str>) -> Result<Option<Logged>, OpenError> {
        let _ = (of, topic);
        Ok(None)
    }

    /// The samples of other sensors that were recorded with the scan that was read last, in the
    /// order of their stamps: of a recording of a run with such sensors.
    fn samples(&self) -> &[Sample] {
        &[]
    }
}

/// Opens the dataset at `root`: the folder that holds the radar's folder, or the folder of images
/// itself.
///
/// The format is detected unless `options` names it. Options that are not set are read from a
/// `dataset.toml` in the folder, if there is one.
pub fn open(root: &Path, options: &DatasetOptions) -> Result<Box<dyn Dataset>, OpenError> {
    open_resolved(root, &options.or(&stored_options(root)?))
}

/// Opens the dataset at `root` with these options only: the current `dataset.toml` is ignored.
pub fn open_resolved(root: &Path, options: &DatasetOptions) -> Result<Box<dyn Dataset>, OpenError> {
    options.check()?;
    open_found(detect::locate(root, options.format)?, options)
}

/// Opens a dataset again as [`open_resolved`] has opened it before, with the format and the files
/// that it had then. The folder is not listed, so it does not matter how many files it holds, or
/// whether some came or went.
pub fn reopen(
    root: &Path,
    options: &DatasetOptions,
    format: Format,
    files: Vec<PathBuf>,
) -> Result<Box<dyn Dataset>, OpenError> {
    options.check()?;
    open_found(detect::Found::listed(root, format, files)?, options)
}

/// Opens a recording that is not on disk, in its own format unless `options` names another.
pub fn open_source(
    source: Box<dyn ImageSource>,
    options: &DatasetOptions,
) -> Result<Box<dyn Dataset>, OpenError> {
    options.check()?;
    open_found(detect::Found::source(source, options.format)?, options)
}

fn open_found(
    found: detect::Found,
    options: &DatasetOptions,
) -> Result<Box<dyn Dataset>, OpenError> {
    options.check_without_topics(found.format)?;
    Ok(match found.format {
        Format::Mulran => Box::new(transposed::open_mulran(found, options)?),
        Format::Radiate => Box::new(radiate::open(found, options)?),
        format => match profiles::Profile::of(format) {
            Some(profile) => Box::new(navtech_scans::NavtechScans::open(found, options, profile)?),
            None => {
                let fault =
                    format!("is a folder of images, and the format `{format}` is not of images");
                return Err(OpenError::at(&found.folder, fault));
            }
        },
    })
}

/// Checks by the first scan of a recording that its radar measures the velocity by Doppler: see
/// [`check_chirps`]. A scan that cannot be read is reported where it is played.
pub fn check_first_scan(dataset: &mut dyn Dataset) -> Result<(), NoDoppler> {
    match dataset.scan(dataset.first()) {
        Ok(scan) => check_chirps(&scan.view()),
        Err(_) => Ok(()),
    }
}
