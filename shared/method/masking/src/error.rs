use gyre_geometry::{ScanError, SettingError};
use gyre_radar::raster::RasterError;
use thiserror::Error;

use crate::{MaskingConfigError, network::NetworkError};

#[derive(Debug, Error)]
pub enum MaskerError {
    #[error("masking.{0}")]
    Masking(#[from] MaskingConfigError),
    #[error(transparent)]
    Raster(#[from] RasterError),
    #[error(transparent)]
    Points(#[from] SettingError),
    #[error(transparent)]
    Network(#[from] NetworkError),
}

#[derive(Debug, Error)]
pub enum MaskError {
    #[error(transparent)]
    Raster(#[from] RasterError),
    #[error(transparent)]
    Scan(#[from] ScanError),
    #[error(transparent)]
    Network(#[from] NetworkError),
    #[error("{0}")]
    Function(String),
    #[error(
        "the mask takes two scans, but the previous scan {0} or the output for its raster is missing"
    )]
    MissingPrevious(u64),
}
