//! How well a planar trajectory fits its ground truth: KITTI, ATE, RPE and seg, NEES of its covariances, and plots of them.
//!
//! Pure mathematics on slices of poses and stamps; files are read elsewhere. Poses are
//! [`nalgebra::Isometry2<f64>`] ([`Pose`]), each the pose of the sensor in some fixed frame (REP-103: x forward, y left,
//! yaw counter-clockwise); stamps are nanoseconds. The fixed frames of estimate and truth need not agree.
//!
//! Reading order:
//! - [`report`]: [`evaluate`] is the whole method, one line a step;
//! - [`mod@associate`]: which pose of the estimate is held against which pose of the truth;
//! - [`mirror`]: axes that run the other way, found and undone;
//! - [`mod@ate`], [`mod@kitti`], [`mod@seg`], [`mod@end`], [`mod@rpe`]: one metric each, on [`MatchedPoses`];
//! - [`motions`]: reported motions with covariances, all or those of a part, each beside its truth;
//! - [`mod@nees`], [`mod@bands`]: whether these covariances are honest, as figures and over time;
//! - [`plot`]: trajectory, errors and bands as SVG.
//!
//! ```
//! use gyre_evaluation::{Association, Options, Pose, Trajectory, evaluate};
//!
//! let truth: Vec<_> = (0..200).map(|k| Pose::translation(k as f64, 0.0)).collect();
//! let estimate: Vec<_> = (0..200).map(|k| Pose::translation(1.01 * k as f64, 5.0)).collect();
//! let options = Options { association: Association::Index, ..Options::default() };
//! let evaluation = evaluate(Trajectory::untimed(&estimate), Trajectory::untimed(&truth), &options)?;
//! let kitti = evaluation.kitti.as_ref().ok_or("shorter than 100 m")?;
//! assert!((kitti.translation_percent - 1.01).abs() < 1e-9); // 1 % of the 101 m that exceed 100 m
//! println!("{evaluation}");
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```

pub mod associate;
pub mod ate;
pub mod bands;
mod chi_square;
mod covariance;
mod display;
pub mod end;
mod error;
pub mod kitti;
mod matched;
pub mod mirror;
pub mod motions;
pub mod nees;
pub mod plot;
pub mod report;
pub mod rpe;
pub mod seg;
mod stretches;

pub use associate::{Association, Coverage, Trajectory, associate};
pub use ate::{Ate, align, ate};
pub use bands::{BandSample, Bands, bands};
pub use covariance::{TruthSigma, UncertainMotion};
pub use end::{EndError, end_error};
pub use error::{EvaluationError, Side};
pub use kitti::{Kitti, kitti};
pub use matched::MatchedPoses;
pub use mirror::{Axes, HeadingFault};
pub use motions::{JudgedMotions, Motion, Part};
pub use nees::{Nees, NeesFigure, NeesFigures, NeesLength, NeesOptions, nees};
pub use plot::{PlotError, plot_bands, plot_errors, plot_trajectory};
pub use report::{Evaluation, Options, evaluate};
pub use rpe::{PairError, Rpe, rpe};
pub use seg::{Seg, seg};
pub use stretches::STRETCH_LENGTHS_M;

/// The pose of a sensor in some fixed frame: metres, radians.
pub type Pose = nalgebra::Isometry2<f64>;

/// The pose (x, y, yaw).
#[cfg(test)]
fn pose(x_m: f64, y_m: f64, yaw_rad: f64) -> Pose {
    Pose::new(nalgebra::Vector2::new(x_m, y_m), yaw_rad)
}
