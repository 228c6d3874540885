//! Polar radar scans: their grid, lost azimuths, rasters and sparse points.

mod chain;
mod clock;
pub mod doppler;
pub mod fourier;
pub mod lost;
mod median;
pub mod points;
pub mod raster;
pub mod scan;
pub mod trajectory;

pub use chain::{MAX_INTERVAL_NS, continues};
pub use clock::{ClockOffset, MAX_OFFSET_S, clock_offset};
pub use doppler::{DopplerEstimator, NoDoppler, check_chirps};
pub use gyre_geometry::SettingError;
pub use lost::{LostAzimuthFinder, LostAzimuths, PlacedRows};
pub use median::median;
pub use points::{PointExtractor, PointsConfig};
pub use raster::{RasterConfig, RasterError, Rasteriser, Sampling};
pub use scan::{
    MAX_AZIMUTHS, OwnedScan, PolarScan, ScanError, ScanLimits, ScanSlot, Sense, SweepGeometry,
};
pub use trajectory::Trajectory;
