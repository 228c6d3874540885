//! The check that configuration values lie within their limits.

use crate::error::SimulatorError;

pub(crate) fn require_within(
    key: &'static str,
    value: f64,
    min: f64,
    max: f64,
) -> Result<(), SimulatorError> {
    if (min..=max).contains(&value) {
        return Ok(());
    }
    let expected = format!("between {min} and {max}");
    Err(SimulatorError::key(key, value, expected))
}
