//! Simulated drives: towns, traffic, weather, and spinning FMCW radars that are fitted to real
//! ones.
//!
//! A vehicle with a spinning radar drives through a procedural town. The result is a dataset in
//! Oxford's, Boreas' or RADIATE's format with exact ground truth, written to a disk or streamed
//! into a pipeline. In the order of the data:
//!
//! - [`config`]: the configuration,
//! - [`drive`], [`path`]: the path of the sensor, a pose for every instant,
//! - [`lanes`], [`streets`]: the network of streets,
//! - [`town`], [`tunnel`], [`traffic`]: what stands along them and what moves on them,
//! - [`body`], [`world`], [`occlusion`]: scatterers and walls, and which walls lie between two
//!   points,
//! - [`relief`]: the height of the ground,
//! - [`profile`]: the radars; [`weather`]: rain, fog and snow,
//! - [`sensor`]: the measurement of one sweep; [`gyro`], [`wheels`]: what a gyro beside the radar
//!   and the wheels measure,
//! - [`simulator`]: single scans with their exact poses,
//! - [`output`], [`simulated_drive`], [`truth`], `objects`: the drive in a dataset format, with the
//!   truth about the sensor and about the road users,
//! - [`writer`]: the same on a disk.
//!
//! `gallery/README.md` in the crate's folder shows each effect of the sensor off and on; `cargo run
//! --release -p gyre-worlds --example gallery` draws it.
//!
//! ```
//! use gyre_worlds::{SimulationConfig, Simulator};
//!
//! let simulator = Simulator::new(&SimulationConfig { scans: Some(2), ..SimulationConfig::default() })?;
//! let first = simulator.render_scan(0);
//! assert_eq!(first.scan.view().geometry.azimuths, 400);
//! let motion = simulator.pose(0).inverse() * simulator.pose(1);
//! assert!(motion.translation.x > 1.0, "metres ahead in a quarter of a second");
//! # Ok::<(), gyre_worlds::SimulatorError>(())
//! ```

pub mod body;
pub mod config;
pub mod drive;
pub mod error;
pub mod gnss;
pub mod gyro;
mod image;
mod interpolate;
pub mod lanes;
mod layout;
mod limits;
mod objects;
pub mod occlusion;
pub mod output;
pub mod path;
mod place_noise;
pub mod profile;
mod realism;
pub mod relief;
mod render_ahead;
pub mod sensor;
pub mod simulated_drive;
pub mod simulator;
mod stream;
pub mod streets;
pub mod town;
pub mod traffic;
pub mod truth;
pub mod tunnel;
pub mod weather;
pub mod wheels;
pub mod world;
pub mod writer;

pub use body::{Body, Movers, Moving};
pub use config::SimulationConfig;
pub use error::SimulatorError;
pub use gnss::SimulatedGnssConfig;
pub use gyro::{GyroProfile, SimulatedGyroConfig};
pub use lanes::DrivingSide;
pub use output::{HostStamps, OutputFormat};
pub use path::{BlockLoop, Path, SplinePath};
pub use profile::{Profile, Sampling};
pub use realism::Realism;
pub use relief::Relief;
pub use sensor::{Effects, Scene, Sensor, SensorConfig, SweepTime};
pub use simulated_drive::{Renderer, SimulatedDrive};
pub use simulator::{SimulatedScan, Simulator};
pub use streets::{Street, Streets};
pub use traffic::RoadUser;
pub use tunnel::TunnelConfig;
pub use wheels::SimulatedWheelsConfig;
pub use world::World;
pub use writer::{Summary, remove_dataset, write_dataset, write_dataset_on};
