//! Plots of trajectories, errors and error bands as SVG.
//!
//! Text stays text in the viewer's sans-serif font: neither building nor running needs fonts.

mod bands;
pub mod canvas;
mod errors;
mod trajectory;

use std::{
    io,
    path::{Path, PathBuf},
};

pub use bands::bands_svg;
pub use errors::errors_svg;
pub use trajectory::{path_svg, trajectory_svg};

use gyre_geometry::Pose;

use crate::{Bands, Evaluation, EvaluationError, MatchedPoses};

/// The reason why a plot was not made.
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
    /// The file could not be written.
    #[error("failed to write {path}: {source}", path = path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// The error of the system.
        source: io::Error,
    },
}

/// Draws `estimate`, over `truth` if given, into an SVG file: equal axes in metres, start marked.
///
/// The ground truth must have as many poses; the estimate is aligned with it in SE(2). An
/// [`Evaluation`] holds such poses, of one handedness:
/// `plot_trajectory(path, e.matched.estimate(), Some(e.matched.truth()))`.
///
/// # Errors
/// [`PlotError`] if there are no poses, if poses are invalid or differ in number, or if the file
/// cannot be written.
pub fn plot_trajectory(
    path: &Path,
    estimate: &[Pose],
    truth: Option<&[Pose]>,
) -> Result<(), PlotError> {
    let svg = match truth {
        Some(truth) => trajectory_svg(
            estimate,
            Some(&MatchedPoses::new(estimate.to_vec(), truth.to_vec())?),
        )?,
        None => trajectory_svg(estimate, None)?,
    };
    write(path, &svg)
}

/// Draws the KITTI errors over segment length into an SVG file, or, if the path is too short for
/// them, the RPE over the distance travelled.
///
/// # Errors
/// [`PlotError`] if the evaluation has neither (a ground truth without heading), or if the file
/// cannot be written.
pub fn plot_errors(path: &Path, evaluation: &Evaluation) -> Result<(), PlotError> {
    write(path, &errors_svg(evaluation)?)
}

/// Draws the error of the composed poses in x, y and yaw over time into an SVG file, with 3-sigma
/// bands.
///
/// # Errors
/// [`PlotError`] if no pose has ground truth, or if the file cannot be written.
pub fn plot_bands(path: &Path, bands: &Bands) -> Result<(), PlotError> {
    write(path, &bands_svg(bands)?)
}

fn write(path: &Path, svg: &str) -> Result<(), PlotError> {
    std::fs::write(path, svg).map_err(|source| PlotError::Write {
        path: path.to_owned(),
        source,
    })
}
