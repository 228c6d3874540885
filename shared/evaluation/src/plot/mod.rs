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

use crate::EvaluationError;

#[derive(Debug, thiserror::Error)]
pub enum PlotError {
    /// There is no pose to draw.
    #[error("there is no pose to plot")]
    Empty,
    /// The poses cannot be compared.
    #[error(transparent)]
    Poses(#[from] EvaluationError),
    /// The error message of the drawing library.
    #[error("failed to draw: {0}")]
    Draw(String),
}
