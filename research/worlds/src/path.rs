//! The path of the sensor: its pose at every instant.

pub mod recorded;
mod town_drive;

pub use gyre_simulator::path::{BlockLoop, Path, SplinePath, spline};
pub use town_drive::TownDrive;
