//! Why a command has failed.

use std::error::Error;

/// A sentence for the person at the terminal.
pub type Failure = Box<dyn Error + Send + Sync>;
