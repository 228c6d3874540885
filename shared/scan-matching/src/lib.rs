//! The decoupled Fourier search for rotation and translation (Weston et al., Algorithm 1).
//!
//! Two scans f (later) and g (earlier) of the same place are alike after a motion, f(x) ~ g(R x + t): (R, t) is the
//! pose of the later scan's frame in the earlier one's. The search finds R from the magnitude spectra alone, which a
//! shift leaves as they are, then t by one correlation.
//!
//! # Layout, in the order of the data
//! - `window`, `fft`, `polar`: a raster's magnitude spectrum on a polar grid;
//! - `spectrum`: [`PolarSpectrum`], what is kept of a scan; `rotation`: [`RotationSearch`], the angle;
//! - `warp`: the earlier raster turned by it;
//! - `translation`: [`TranslationSearch`], the shift and the whole motion; `scores`: one a shift; `overlap` normalises them;
//! - `exhaustive`: [`ExhaustiveSearch`], all three unknowns at once, angle by angle; `correlate`: its transforms;
//! - `refinement`: [`Refinement`], the motion below a cell, against a map of the last keyframes;
//! - `peak`: maxima between samples; `covariance`: what their shapes say; `whiten`: phase-only correlation; `kernels`:
//!   inner loops.
//!
//! # Frames
//! x forward, y left, yaw counter-clockwise; metres and radians. A raster is n x n `f32`, row after row, row 0 far
//! ahead, column 0 far left, the sensor in the middle: the centre of the middle cell where n is odd.
//!
//! ```
//! use gyre_scan_matching::{RotationConfig, RotationSearch, TranslationConfig, TranslationSearch};
//!
//! # fn main() -> Result<(), Box<dyn std::error::Error>> {
//! let (n, cell_m) = (127, 0.8);
//! let mut rotation = RotationSearch::new(n, &RotationConfig::default())?;
//! let mut translation = TranslationSearch::new(n, cell_m, &TranslationConfig::default())?;
//! let (mut earlier_spectrum, mut later_spectrum) = (rotation.new_spectrum(), rotation.new_spectrum());
//!
//! // Everything comes nearer by two cells: the sensor drove 1.6 m ahead.
//! let (mut earlier, mut later) = (vec![0.0_f32; n * n], vec![0.0_f32; n * n]);
//! for (row, col) in [(30, 40), (41, 75), (48, 52), (70, 90), (85, 33), (92, 61)] {
//!     earlier[row * n + col] = 1.0;
//!     later[(row + 2) * n + col] = 1.0;
//! }
//!
//! rotation.spectrum(&earlier, &mut earlier_spectrum)?;
//! rotation.spectrum(&later, &mut later_spectrum)?;
//! let angle = rotation.search(&later_spectrum, &earlier_spectrum)?;
//! let motion = translation.search(&later, &earlier, &angle)?;
//! assert!((motion.x_m - 1.6).abs() < 0.01 && motion.y_m.abs() < 0.01);
//! # Ok(())
//! # }
//! ```

mod config;
mod correlate;
mod covariance;
mod exhaustive;
mod fft;
mod kernels;
mod overlap;
mod peak;
mod polar;
mod refinement;
mod rotation;
mod scores;
mod spectrum;
mod translation;
mod warp;
mod whiten;
mod window;

pub use config::{
    ConfigError, Magnitude, Overlap, Peak, RotationConfig, RotationForm, TranslationConfig, Window,
};
pub use exhaustive::{ExhaustiveConfig, ExhaustiveSearch, JointEstimate};
pub use fft::fast_size;
pub use refinement::{
    Anchor, Hypothesis, Keyframe, Memory, Outcome, Refined, Refinement, RefinementConfig,
    RefinementKind,
};
pub use rotation::{RotationEstimate, RotationRunnerUp, RotationSearch};
pub use spectrum::PolarSpectrum;
pub use translation::{MotionEstimate, MotionRunnerUp, TranslationSearch};

/// A slice of another length than the search was planned for.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("{what} has {actual} values: expected {expected}")]
pub struct ShapeError {
    /// Which slice.
    pub what: &'static str,
    /// Its length.
    pub actual: usize,
    /// The length that the search was planned for.
    pub expected: usize,
}

fn expect_shape(what: &'static str, actual: usize, expected: usize) -> Result<(), ShapeError> {
    if actual == expected {
        Ok(())
    } else {
        Err(ShapeError {
            what,
            actual,
            expected,
        })
    }
}
