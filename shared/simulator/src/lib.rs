//! Simulated drives: towns, traffic, weather, and spinning FMCW radars that are fitted to real ones.
//!
//! A vehicle with a spinning radar drives through a procedural town; what comes out is a recording in Oxford's, Boreas' or RADIATE's
//! form with exact ground truth, on a disk or straight into a pipeline. In the order in which the data come about:
//!
//! - [`config`]: what to simulate,
//! - [`drive`], [`path`]: which way is taken, and where the sensor is at any instant,
//! - [`streets`]: the ways through the town,
//! - [`town`], [`traffic`]: what stands and what moves around it,
//! - [`body`], [`world`], [`occlusion`]: how that reflects, and what hides what,
//! - [`profile`]: the radars, [`weather`]: rain, fog and snow,
//! - [`sensor`]: what a sweep measures of it,
//! - [`simulator`]: one scan at a time, with its exact pose,
//! - [`output`], [`simulated_drive`], [`truth`]: the drive as a recording of a dataset's form,
//! - [`writer`]: that on a disk.
//!
//! What each effect of the sensor looks like, off and on, is in `gallery/README.md` in the crate's folder, which
//! `cargo run --release -p gyre-simulator --example gallery` draws.
//!
//! ```
//! use gyre_simulator::{SimulationConfig, Simulator};
//!
//! let simulator = Simulator::new(&SimulationConfig { scans: 2, ..SimulationConfig::default() })?;
//! let first = simulator.render_scan(0);
//! assert_eq!(first.scan.view().geometry.azimuths, 400);
//! let motion = simulator.pose(0).inverse() * simulator.pose(1);
//! assert!(motion.translation.x > 1.0, "metres ahead in a quarter of a second");
//! # Ok::<(), gyre_simulator::SimulatorError>(())
//! ```

pub mod body;
pub mod config;
pub mod drive;
pub mod error;
mod image;
mod interpolate;
pub mod lanes;
mod layout;
mod limits;
pub mod occlusion;
pub mod output;
pub mod path;
pub mod profile;
pub mod sensor;
pub mod simulated_drive;
pub mod simulator;
mod stream;
pub mod streets;
pub mod town;
pub mod traffic;
pub mod truth;
pub mod weather;
pub mod world;
pub mod writer;

pub use body::{Body, Movers, Moving};
pub use config::SimulationConfig;
pub use error::SimulatorError;
pub use lanes::DrivingSide;
pub use output::{HostStamps, OutputFormat};
pub use path::{BlockLoop, Path, SplinePath};
pub use profile::{Profile, Sampling};
pub use sensor::{Effects, Scene, Sensor, SensorConfig, SweepTime};
pub use simulated_drive::{Renderer, SimulatedDrive};
pub use simulator::{SimulatedScan, Simulator};
pub use streets::{Street, Streets};
pub use world::World;
pub use writer::{Summary, write_dataset, write_dataset_on};
