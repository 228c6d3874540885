//! The gyro beside the radar: the section `[simulation.gyro]`, and the log that it leaves.
//!
//! In the order of the data:
//!
//! - [`config`]: the configuration;
//! - `attitude`: the vehicle's rates of rotation and accelerations, from its path and the hills;
//! - `errors`: what the sensor makes of them;
//! - `clock`: the stamps, and which samples are lost;
//! - `log`: the samples as a log has them.

mod attitude;
mod clock;
pub mod config;
mod errors;
pub(crate) mod log;
#[cfg(test)]
mod tests;

pub(crate) use attitude::Vehicle;
pub use config::SimulatedGyroConfig;
pub use gyre_simulator::gyro::{GyroFigures, GyroProfile};
