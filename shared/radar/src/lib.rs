//! Polar radar scans: readers, ground truth, rasterisation.

pub mod boreas;
pub mod dataset;
mod detect;
pub mod error;
mod first_look;
pub mod fomo;
mod images;
pub mod mulran;
mod navtech_png;
mod navtech_scans;
pub mod options;
pub mod oxford;
pub mod png_image;
mod radiate;
pub mod scan;
mod sensor_clock;
mod sideways;
mod stamp;

pub use dataset::{Dataset, open};
pub use error::{OpenError, ReadError};
pub use options::{AzimuthSource, DatasetOptions, Format};
pub use png_image::ImageSize;
pub use scan::{MAX_AZIMUTHS, OwnedScan, PolarScan, ScanLimits, ScanSlot, Sense, SweepGeometry};
