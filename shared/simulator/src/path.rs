mod block;
mod continuous;
pub mod recorded;
pub mod spline;
mod spline_path;

pub use block::BlockLoop;
pub use continuous::Path;
pub use spline_path::SplinePath;
