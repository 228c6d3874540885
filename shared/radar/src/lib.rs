//! Polar radar scans: readers, ground truth, rasterisation.

pub mod boreas;
pub mod dataset;
mod detect;
pub mod error;
mod first_look;
pub mod fomo;
pub mod ground_truth;
mod images;
pub mod inspect;
pub mod mulran;
mod navtech_png;
mod navtech_scans;
pub mod options;
pub mod oxford;
pub mod png_image;
mod radiate;
pub mod raster;
pub mod scan;
mod sensor_clock;
mod sideways;
mod stamp;
pub mod trajectory;

pub use dataset::{Dataset, open};
pub use error::{OpenError, ReadError};
pub use ground_truth::{TrajectoryError, find_ground_truth, read_trajectory, write_kitti, write_tum};
pub use inspect::{Report, inspect};
pub use options::{AzimuthSource, DatasetOptions, Format};
pub use png_image::ImageSize;
pub use raster::{RasterConfig, RasterError, Rasteriser, Sampling, Twist};
pub use scan::{MAX_AZIMUTHS, OwnedScan, PolarScan, ScanLimits, ScanSlot, Sense, SweepGeometry};
pub use trajectory::Trajectory;
