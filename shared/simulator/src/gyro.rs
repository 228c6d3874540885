//! The gyro beside the radar: the section `[simulation.gyro]`, and the log that it leaves.
//!
//! In the order of the data:
//!
//! - [`config`]: the configuration; [`profile`]: gyros that can be bought;
//! - `attitude`: the vehicle's rate of rotation and acceleration, from its path;
//! - `errors`: the errors of the sensor;
//! - `clock`: the stamps, and which samples are lost;
//! - `log`: the samples as a log has them.

mod attitude;
mod clock;
pub mod config;
mod errors;
pub(crate) mod log;
pub mod profile;
#[cfg(test)]
mod tests;

pub use config::SimulatedGyroConfig;
pub use profile::{GyroFigures, GyroProfile};
