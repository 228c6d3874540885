//! A small honest radar simulator for demonstrations and tests.
//!
//! A vehicle with a spinning radar drives through a procedural town, around a block, at random or along a recorded
//! trajectory; what comes out is a dataset
//! in Oxford Radar RobotCar's layout with exact ground truth. In the order in which the data come about:
//!
//! - [`config`]: what to simulate,
//! - [`drive`], [`trajectory`]: which way is taken, and where the sensor is at any instant,
//! - [`streets`]: the ways through the town,
//! - [`town`], [`traffic`]: what stands and what moves around it,
//! - [`world`], [`occlusion`]: how that reflects, and what hides what,
//! - [`sensor`], [`receiver`]: what a sweep measures of it,
//! - [`simulator`]: one scan at a time, with its exact pose,
//! - [`oxford_writer`]: the dataset on disk,
//! - [`faults`]: the same, or a real one, spoilt on purpose.
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

pub mod config;
pub mod drive;
pub mod error;
pub mod faults;
mod image;
pub mod occlusion;
pub mod oxford_writer;
pub mod profile;
pub mod receiver;
pub mod sensor;
pub mod simulator;
pub mod streets;
pub mod town;
pub mod traffic;
pub mod trajectory;
pub mod world;

pub use config::SimulationConfig;
pub use error::SimulatorError;
pub use faults::{Fault, FaultPlan, write_faulty};
pub use oxford_writer::{Summary, write_dataset};
pub use profile::{Profile, Sampling};
pub use sensor::{Sensor, SweepTime};
pub use simulator::{SimulatedScan, Simulator};
pub use streets::{Keep, Street, Streets};
pub use trajectory::{BlockLoop, ConstantTwist, TimedPoses, Trajectory};
pub use world::{Body, Movers, Moving, World};
