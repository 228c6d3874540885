//! The check that configuration values lie within their limits.

use crate::error::SimulatorError;

/// Checks that `value` lies in `min..=max`.
pub(crate) fn require_within(
    key: &'static str,
    value: f64,
    min: f64,
    max: f64,
) -> Result<(), SimulatorError> {
    if (min..=max).contains(&value) {
        return Ok(());
    }
    Err(SimulatorError::Config {
        key,
        value: value.to_string(),
        expected: format!("between {min} and {max}"),
    })
}
