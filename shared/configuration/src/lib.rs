//! Configurations: TOML that is read strictly and overridden key by key, and the settings of a
//! recording that is played without a configuration. [`MethodConfig`] has the settings of the
//! method alone; with the feature `run`, `Configuration` has the settings of a run of processes.

mod automatic;
pub mod calibration;
#[cfg(feature = "run")]
mod configuration;
#[cfg(feature = "run")]
mod masks;
mod method;
pub mod paths;
#[cfg(feature = "run")]
mod scans;
#[cfg(feature = "run")]
pub mod schema;
pub mod strict;
#[cfg(feature = "run")]
pub mod terminal;

pub use automatic::{Automatic, AutomaticError, automatic, noise_floor, radar_constants};
#[cfg(feature = "run")]
pub use configuration::{Configuration, difference, process_names};
#[cfg(feature = "run")]
pub use masks::{describe_masks, describe_masks_in_process, describe_objects};
pub use method::MethodConfig;
#[cfg(feature = "run")]
pub use scans::{Played, fingerprint, gnss_log, open, simulated_samples, with_stored_options};

#[derive(Debug, thiserror::Error)]
#[error("{0}")]
pub struct ConfigurationError(pub String);
