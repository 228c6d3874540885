//! Trajectories, errors and their bands as SVG, readable on paper and in a browser.
//!
//! Text stays text (drawn by the viewer's sans-serif font): nothing needs fonts when it is built or run.

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
pub use trajectory::trajectory_svg;

use gyre_geometry::Pose;

use crate::{Bands, Evaluation, EvaluationError, MatchedPoses};

/// Why a plot was not made.
#[derive(Debug, thiserror::Error)]
pub enum PlotError {
    /// There is nothing to draw.
    #[error("there is no pose to plot")]
    Empty,
    /// The poses cannot be held against each other.
    #[error(transparent)]
    Poses(#[from] EvaluationError),
    /// The drawing library refused; its words.
    #[error("failed to draw: {0}")]
    Draw(String),
    /// The file could not be written.
    #[error("failed to write {path}: {source}", path = path.display())]
    Write {
        /// The file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
}

/// Draws `estimate`, against `truth` where there is one, into an SVG file: equal axes in metres, start marked.
///
/// With a truth, which must have as many poses, the estimate is first aligned to it by SE(2), and the caption says so.
/// An [`Evaluation`] holds such poses, in one handedness:
/// `plot_trajectory(path, e.matched.estimate(), Some(e.matched.truth()))`.
///
/// # Errors
/// [`PlotError`]: no poses, poses that are none or not equally many, a file that cannot be written.
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

/// Draws the errors over distance into an SVG file: KITTI's translation and rotation error for each length, or, where
/// the path is too short for them, the error of each pair over the distance travelled.
///
/// # Errors
/// [`PlotError`]: neither kind of error is there (a truth without heading), a file that cannot be written.
pub fn plot_errors(path: &Path, evaluation: &Evaluation) -> Result<(), PlotError> {
    write(path, &errors_svg(evaluation)?)
}

/// Draws the error of the composed poses over time into an SVG file, x, y and yaw, each within its band of 3 standard
/// deviations.
///
/// # Errors
/// [`PlotError`]: no pose has truth, a file that cannot be written.
pub fn plot_bands(path: &Path, bands: &Bands) -> Result<(), PlotError> {
    write(path, &bands_svg(bands)?)
}

fn write(path: &Path, svg: &str) -> Result<(), PlotError> {
    std::fs::write(path, svg).map_err(|source| PlotError::Write {
        path: path.to_owned(),
        source,
    })
}
