//! Plots of trajectories, errors and error bands as SVG.
//!
//! Text stays text in the viewer's sans-serif font: neither building nor running needs fonts.

mod bands;
pub mod canvas;
mod errors;
mod trajectory;

pub use bands::bands_svg;
pub use errors::errors_svg;
pub use trajectory::{path_svg, paths_svg, trajectory_svg};

use crate::evaluation::EvaluationError;

fn no_pose() -> EvaluationError {
    EvaluationError("there is no pose to plot".to_owned())
}
