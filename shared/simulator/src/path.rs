//! The path of the sensor: its pose at every instant.

mod block;
mod continuous;
pub mod recorded;
pub mod spline;
mod spline_path;
mod town_drive;

pub use block::BlockLoop;
pub use continuous::Path;
pub use spline_path::SplinePath;
pub use town_drive::TownDrive;
