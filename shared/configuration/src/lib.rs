//! Configurations: TOML that is read strictly, and overridden key by key; the settings of the
//! method; and those of a recording that is played without a configuration.
//!
//! `gyre` adds what a run of processes needs. Here is what a program needs that computes by itself.

mod automatic;
mod error;
mod method;
pub mod strict;

pub use automatic::{Automatic, AutomaticError, automatic, radar_constants};
pub use error::ConfigurationError;
pub use method::MethodConfig;
