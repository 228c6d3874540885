//! Radar odometry in one process: the whole method on one page.
//!
//! [`Odometry::register`] is the method: compensate, rasterise, mask, rotate, translate, refine,
//! compose. The processes of a run compose the same parts from [`gyre_masking`] and
//! [`gyre_scan_matching`], so their motions are the same bits.
//!
//! Reading order: [`Odometry`]; [`Pair`], the two scans; [`Parts`], the mask, the search and the
//! refinement, which are all replaceable; [`DecoupledSearch`].
//!
//! # Frames and units
//! As in [`gyre_geometry`]: x forward, y left, yaw counter-clockwise; m, rad, s.
//!
//! ```
//! use gyre_odometry::{Odometry, OdometryConfig, Outcome};
//! use gyre_radar::OwnedScan;
//! use gyre_simulator::{SimulatedDrive, SimulationConfig};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! // Any reader of `gyre_radar` gives scans; this drive is generated.
//! let drive = SimulatedDrive::new(&SimulationConfig { scans: Some(2), ..SimulationConfig::default() })?;
//! let options = drive.dataset_options();
//! let mut dataset = gyre_datasets::open_source(Box::new(drive.renderer()), &options)?;
//! let mut scan = OwnedScan::with_limits(dataset.limits());
//!
//! let mut odometry = Odometry::new(&OdometryConfig::default())?;
//! for index in 0..2 {
//!     scan.geometry = dataset.read(index, scan.slot())?;
//!     let registered = odometry.register(&scan.view(), &[])?;
//!     if index == 1 {
//!         assert_eq!(registered.outcome, Outcome::Refined);
//!         assert!(registered.motion.motion.translation.x > 0.5, "the vehicle drives ahead");
//!         assert!(registered.pose.covariance[(0, 0)] > 0.0);
//!     }
//! }
//! # Ok(())
//! # }
//! ```

mod compensation;
mod config;
mod mask;
mod odometry;
mod pair;
mod parts;
mod registered;
mod search;

pub use config::{OdometryConfig, SearchConfig, SearchKind};
pub use mask::{Mask, Rasters};
pub use odometry::Odometry;
pub use pair::Pair;
pub use parts::{Parts, Refine};
pub use registered::{OdometryError, Outcome, Registered, SetupError};
pub use search::{DecoupledSearch, Search};
