//! A recording of radar scans on disk, whatever its format.

mod boreas;
mod detect;
mod eccentricity;
mod error;
mod first_look;
mod fomo;
mod format;
mod image_size;
mod image_source;
mod images;
mod mulran;
mod navtech_png;
mod navtech_scans;
mod options;
mod oxford;
mod png_image;
mod radiate;
mod sensor_clock;
mod sideways;
pub(crate) mod stamp;
mod told;

use std::path::Path;

use crate::scan::{ScanLimits, ScanSlot, SweepGeometry};
pub use error::{OpenError, ReadError};
pub use format::Format;
pub use image_size::ImageSize;
pub use image_source::ImageSource;
pub use options::{AzimuthSource, DatasetOptions};

/// The scans of one recording, in the order of their times.
///
/// A scan that cannot be read gives an error and leaves the others readable.
pub trait Dataset: Send {
    /// The form of its files.
    fn format(&self) -> Format;

    /// Scans.
    fn len(&self) -> usize;

    /// Whether there is no scan; `open` refuses such a folder.
    fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// What memory one scan needs: from the first image's header; every image must have its size.
    fn limits(&self) -> ScanLimits;

    /// Columns and rows of the images as stored.
    fn image_size(&self) -> ImageSize;

    /// Whether the images are stored with range downwards, and turned by [`Dataset::read`].
    fn on_their_side(&self) -> bool {
        false
    }

    /// The file of a scan; an empty path past the end.
    fn file(&self, index: usize) -> &Path;

    /// The scan's time (middle of the sweep on the sensor's clock), ns since 1970, as far as it is known without decoding.
    fn nominal_stamp_ns(&self, index: usize) -> Option<i64>;

    /// The time that was logged for the scan (file name or list of stamps), ns since 1970, before anything was made of it.
    fn logged_stamp_ns(&self, index: usize) -> Option<i64>;

    /// One sentence: what the stamps mean, and how the middle of the sweep was obtained.
    fn stamp_meaning(&self) -> &'static str;

    /// Encoder counts a turn, where azimuths come from an encoder.
    fn encoder_counts(&self) -> Option<u16>;

    /// What the reader noticed when it opened the dataset, and what it made of that: whole sentences.
    fn notes(&self) -> &[String];

    /// Decodes a scan into `slot`, whose slices are at least as long as [`Dataset::limits`] say.
    fn read(&mut self, index: usize, slot: ScanSlot<'_>) -> Result<SweepGeometry, ReadError>;
}

/// Opens the dataset at `root`: the folder that holds the radar's folder, or the folder of images itself.
///
/// The format is detected unless `options` names it. What `options` leave open is taken from a `dataset.toml` in the folder, if
/// there is one: the recording's word on itself.
pub fn open(root: &Path, options: &DatasetOptions) -> Result<Box<dyn Dataset>, OpenError> {
    let options = options.or(&told::options(root)?);
    options.check()?;
    read_as_found(detect::locate(root, options.format)?, &options)
}

/// Opens a recording that lies on no disk: in its own format, unless `options` name another.
pub fn open_source(
    source: Box<dyn ImageSource>,
    options: &DatasetOptions,
) -> Result<Box<dyn Dataset>, OpenError> {
    options.check()?;
    read_as_found(detect::Found::source(source, options.format)?, options)
}

fn read_as_found(
    found: detect::Found,
    options: &DatasetOptions,
) -> Result<Box<dyn Dataset>, OpenError> {
    Ok(match found.format {
        Format::Oxford => Box::new(oxford::open(found, options)?),
        Format::Oord => Box::new(oxford::open_oord(found, options)?),
        Format::Boreas => Box::new(boreas::open(found, options)?),
        Format::BoreasRt => Box::new(boreas::open_road_trip(found, options)?),
        Format::Mulran => Box::new(mulran::MulranPolar::open(found, options)?),
        Format::MulranOxfordForm => Box::new(mulran::open_oxford_form(found, options)?),
        Format::Radiate => Box::new(radiate::Radiate::open(found, options)?),
        Format::Fomo => Box::new(fomo::open(found, options)?),
    })
}
