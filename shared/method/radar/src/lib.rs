//! Polar radar scans: their grid, lost azimuths, rasters and sparse points.

mod clock;
pub mod doppler;
pub mod fourier;
pub mod lost;
mod median;
pub mod points;
pub mod raster;
pub mod trajectory;

pub use clock::{ClockOffset, MAX_OFFSET_S, clock_offset};
pub use doppler::{DopplerEstimator, NoDoppler, check_chirps};
pub use gyre_geometry::SettingError;
pub use lost::{LostAzimuthFinder, PlacedRows};
pub use median::median;
pub use points::{PointExtractor, PointsConfig};
pub use raster::{RasterConfig, RasterError, Rasteriser, Sampling};
pub use trajectory::Trajectory;
