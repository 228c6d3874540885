//! The decoupled Fourier search for rotation and translation (Weston et al., Algorithm 1).
//!
//! Two scans f (later) and g (earlier) of the same place satisfy f(x) ~ g(R x + t) (Eq. 1): (R, t)
//! is the pose of the later scan's frame in the earlier one's. The search finds R from the
//! magnitude spectra, which a shift does not change, and then t by one correlation.
//!
//! # Frames and shapes
//! x forward, y left, yaw counter-clockwise; metres and radians. A raster is n x n `f32` in
//! standard (row-major, contiguous) layout: row 0 is far ahead, column 0 far left, and the sensor
//! is in the middle, which is the centre of the middle cell if n is odd. A motion is the pose of
//! the later scan's frame in the earlier scan's frame.

mod config;
mod correlate;
mod covariance;
mod exhaustive;
mod fft;
mod kernels;
mod masked_correlation;
pub mod odometry;
mod overlap;
mod peak;
mod polar;
mod refinement;
mod rotation;
mod scores;
mod sequential;
mod spectrum;
mod taper;
mod translation;
mod warp;
mod whiten;

use ndarray::ArrayView2;

pub use config::{
    Magnitude, Overlap, Peak, RotationConfig, RotationForm, Taper, TranslationConfig,
};
pub use exhaustive::{ExhaustiveConfig, ExhaustiveSearch, JointMatch};
pub use fft::fast_size;
pub use gyre_geometry::SettingError;
pub use masked_correlation::MaskedCorrelation;
pub use peak::{LinePeak, line_peak};
pub use refinement::{
    Anchor, Filter, InitialGuess, Keyframe, KeyframeAligner, Outcome, Refined, RefinementConfig,
    RefinementKind, Refiner, Searched, SinceMatch, Standstill, Submap, TrackerState, Verdict,
    Witnessed,
};
pub use rotation::{RotationMatch, RotationRunnerUp, RotationSearch};
pub use sequential::SequentialRotation;
pub use spectrum::PolarSpectrum;
pub use translation::{MotionMatch, MotionRunnerUp, TranslationSearch};

/// A raster or a spectrum that does not fit the search.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct ShapeError(String);

impl ShapeError {
    fn layout(what: &str) -> Self {
        Self(format!("{what} is not in row-major, contiguous layout"))
    }
}

fn expect_shape(what: &str, actual: [usize; 2], expected: [usize; 2]) -> Result<(), ShapeError> {
    let by = |[rows, columns]: [usize; 2]| format!("{rows} x {columns}");
    match actual == expected {
        true => Ok(()),
        false => {
            let (actual, expected) = (by(actual), by(expected));
            Err(ShapeError(format!(
                "{what} is {actual}: expected {expected}"
            )))
        }
    }
}

fn cells<'a>(what: &str, raster: &ArrayView2<'a, f32>, n: usize) -> Result<&'a [f32], ShapeError> {
    expect_shape(what, [raster.nrows(), raster.ncols()], [n, n])?;
    raster.to_slice().ok_or_else(|| ShapeError::layout(what))
}
