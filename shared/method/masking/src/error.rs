//! The errors of a masker.

use gyre_radar::{PointsError, ScanError, raster::RasterError};
use thiserror::Error;

use crate::{MaskingConfigError, network::NetworkError};

/// An invalid configuration of a masker.
#[derive(Debug, Error)]
pub enum MaskerError {
    /// The mask's.
    #[error("masking.{0}")]
    Masking(#[from] MaskingConfigError),
    /// Of the rasters.
    #[error(transparent)]
    Raster(#[from] RasterError),
    /// Of the points.
    #[error(transparent)]
    Points(#[from] PointsError),
    /// Of the network.
    #[error(transparent)]
    Network(#[from] NetworkError),
}

/// An error in masking a scan.
#[derive(Debug, Error)]
pub enum MaskError {
    /// The scan cannot be rasterised.
    #[error(transparent)]
    Raster(#[from] RasterError),
    /// The scan is inconsistent.
    #[error(transparent)]
    Scan(#[from] ScanError),
    /// The network failed.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// A mask of your own failed.
    #[error("{0}")]
    Function(String),
    /// The mask takes two scans, but the previous one or the output for it is missing.
    #[error(
        "the mask takes two scans, but the previous scan {0} or the output for its raster is missing"
    )]
    MissingPrevious(u64),
}
