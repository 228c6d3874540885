//! Why a link fails.

use std::fmt::Display;

use gyre_client::RunError;

pub(crate) fn other_version(other: &str) -> RunError {
    RunError::Input(format!(
        "{other} is another version of gyre: install the same on both"
    ))
}

/// Names the action of zenoh that has failed.
pub(crate) fn failed(action: &str, error: &dyn Display) -> RunError {
    // zenoh appends the place in its sources.
    let text = error.to_string();
    let reason = text.split(" at /").next().unwrap_or_default();
    RunError::Transient(format!("cannot {action}: {reason}"))
}
