//! The error of a calibration.

use std::convert::Infallible;

use gyre_scan_matching::ConfigError;
use gyre_slam::ClosingError;
use thiserror::Error;

#[derive(Debug, Error)]
pub enum CalibrationError {
    #[error(
        "{scans} scans over {path_m:.0} m are too few: the constants show over 100 m and more, so give a longer recording or a larger --scans"
    )]
    TooShort { scans: usize, path_m: f64 },
    #[error(
        "the scans have too little in common to tell the constants: their overlap has no maximum near the configured ones"
    )]
    Undetermined,
    #[error("revisits cannot be found: {0}")]
    Revisits(#[from] ClosingError<Infallible>),
    #[error(
        "--distance-m is {distance_m:.1}, but the path of the scans is {path_m:.1} m: give the length of this drive, from its first scan to its last"
    )]
    Distance { distance_m: f64, path_m: f64 },
    #[error(transparent)]
    Refinement(#[from] ConfigError),
}
