use std::convert::Infallible;

use gyre_matching::SettingError;
use gyre_slam::ClosingError;
use thiserror::Error;

#[derive(Debug, Error)]
pub enum CalibrationError {
    #[error("{0}")]
    Unusable(String),
    #[error("revisits cannot be found: {0}")]
    Revisits(#[from] ClosingError<Infallible>),
    #[error(transparent)]
    Refinement(#[from] SettingError),
}
