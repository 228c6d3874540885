use gyre_matching::SettingError;
use thiserror::Error;

#[derive(Debug, Error)]
pub enum CalibrationError {
    #[error("{0}")]
    Unusable(String),
    #[error(transparent)]
    Refinement(#[from] SettingError),
}
