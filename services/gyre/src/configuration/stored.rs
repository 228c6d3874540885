//! The description that a recording stores of itself, beside the configuration.

use super::Configuration;
use crate::Failure;

impl Configuration {
    /// Returns the configuration with the options of the recording's `dataset.toml` where it has
    /// none.
    ///
    /// # Errors
    /// The file cannot be read.
    pub(crate) fn with_stored_options(&self) -> Result<Self, Failure> {
        let mut resolved = self.clone();
        let data = &self.source.data;
        if self.streamed().is_none() && !data.as_os_str().is_empty() {
            let stored = gyre_recording::stored_options(data)?;
            resolved.dataset = resolved.dataset.or(&stored);
        }
        Ok(resolved)
    }
}
