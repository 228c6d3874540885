//! The whole evaluation: associate, convert the handedness, compute the metrics.

use std::num::NonZeroUsize;

use serde::Serialize;

use crate::{
    Association, Ate, Axes, Coverage, EndError, EvaluationError, Kitti, MatchedPoses, Rpe, Seg,
    TimedPoses, associate, ate, end_error, handedness::resolve_axes, kitti, rpe, seg,
};

/// The options of an evaluation.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Poses from the start of a segment of KITTI and seg to the start of the next; published
    /// figures use 10 or 4.
    pub step: NonZeroUsize,
    /// The rule by which poses are associated.
    pub association: Association,
}

impl Default for Options {
    /// Returns step 10 and association by time.
    fn default() -> Self {
        Self {
            step: NonZeroUsize::MIN.saturating_add(9),
            association: Association::default(),
        }
    }
}

/// All metrics of one estimate. `Display` is a short table; `{:#}` adds a line for each segment
/// length.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Evaluation {
    /// The numbers of poses that were compared.
    pub coverage: Coverage,
    /// The axes that were negated in the estimate.
    pub axes: Axes,
    /// Path length of the ground truth over the matched poses, m.
    pub path_m: f64,
    /// Path length of the estimate over the matched poses, m. Noise makes it longer.
    pub estimated_path_m: f64,
    /// KITTI odometry errors; `None` for a path up to 100 m or a ground truth without heading.
    pub kitti: Option<Kitti>,
    /// Absolute trajectory error.
    pub ate: Ate,
    /// Segment error; `None` for a path up to 100 m.
    pub seg: Option<Seg>,
    /// End-point error; `None` for a ground truth without heading.
    pub end: Option<EndError>,
    /// Relative pose error; `None` for a ground truth without heading.
    pub rpe: Option<Rpe>,
    /// The poses that were compared, the estimate in the handedness of the ground truth but not
    /// aligned; not serialised.
    #[serde(skip)]
    pub matched: MatchedPoses,
}

/// Compares `estimate` with `truth`.
///
/// # Errors
/// Those of [`associate()`]. A path that is too short for KITTI is no error.
pub fn evaluate(
    estimate: TimedPoses<'_>,
    truth: TimedPoses<'_>,
    options: &Options,
) -> Result<Evaluation, EvaluationError> {
    let (matched, coverage) = associate(estimate, truth, options.association)?;
    let (matched, axes) = resolve_axes(matched);
    let has_heading = !axes.truth_lacks_heading;
    Ok(Evaluation {
        coverage,
        axes,
        path_m: crate::matched::path_m(matched.truth()),
        estimated_path_m: crate::matched::path_m(matched.estimate()),
        kitti: has_heading.then(|| kitti(&matched, options.step)).flatten(),
        ate: ate(&matched),
        seg: seg(&matched, options.step),
        end: has_heading.then(|| end_error(&matched)),
        rpe: has_heading.then(|| rpe(&matched)),
        matched,
    })
}
