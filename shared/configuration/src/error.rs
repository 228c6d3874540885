//! Errors of configurations.

use thiserror::Error;

/// Why a configuration is rejected, in a sentence.
#[derive(Debug, Error)]
#[error("{0}")]
pub struct ConfigurationError(pub String);
