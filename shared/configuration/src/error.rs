//! Errors of configurations.

use thiserror::Error;

#[derive(Debug, Error)]
#[error("{0}")]
pub struct ConfigurationError(pub String);
