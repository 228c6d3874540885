//! Simulated drives of a spinning FMCW radar, with exact truth: around a block of houses or along a
//! trajectory, as a dataset in Oxford's, Boreas' or RADIATE's format, written to a disk or streamed
//! into a pipeline. [`simulator`] renders single scans, [`sensor`] measures one sweep.

pub mod beside;
pub mod body;
mod cars;
pub mod config;
pub mod error;
mod layout;
mod objects;
pub mod occlusion;
pub mod output;
pub mod path;
pub mod profile;
mod route;
mod scenery;
pub mod sensor;
pub mod simulated_drive;
pub mod simulator;
mod stream;
pub mod world;
pub mod writer;

pub use beside::{
    gnss::SimulatedGnssConfig,
    gyro::{GyroProfile, SimulatedGyroConfig},
    wheels::SimulatedWheelsConfig,
};
pub use body::{Body, Moving};
pub use config::{DriveConfig, Realism, SimulationConfig};
pub use error::SimulatorError;
pub use output::OutputFormat;
pub use path::{BlockLoop, Path};
pub use profile::{Profile, Sampling};
pub use sensor::{Scene, Sensor, SensorConfig, SweepTime};
pub use simulated_drive::{Renderer, SimulatedDrive};
pub use simulator::Simulator;
pub use world::World;
pub use writer::{Summary, remove_dataset, write_dataset};
