//! Configurations: TOML that is read strictly, and overridden key by key; and those of a recording
//! that is played without one.
//!
//! - [`Configuration`]: that of a run of processes, with the sections of `gyre-run`;
//! - [`MethodConfig`]: the settings of the method alone, for a program that computes by itself;
//! - [`automatic`](automatic()): the settings of a recording without a configuration;
//! - [`open`]: the scans that a configuration names;
//! - [`schema`]: the schema and the reference, made from the structures.

mod automatic;
pub mod calibration;
mod configuration;
mod error;
mod masks;
mod method;
mod scans;
pub mod schema;
pub mod strict;

pub use automatic::{Automatic, AutomaticError, automatic, radar_constants};
pub use configuration::{Configuration, difference, process_names};
pub use error::ConfigurationError;
pub use masks::describe_masks;
pub use method::MethodConfig;
pub use scans::{Played, SourceError, fingerprint, open, with_stored_options};
