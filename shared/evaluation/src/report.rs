//! The whole evaluation: associate, undo mirrored axes, measure.

use std::num::NonZeroUsize;

use serde::Serialize;

use crate::{
    Association, Ate, Axes, Coverage, EndError, EvaluationError, Kitti, MatchedPoses, Rpe, Seg,
    TimedPoses, associate, ate, end_error, handedness::resolve_axes, kitti, rpe, seg,
};

/// How to evaluate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Options {
    /// Poses between the starts of the segments of KITTI and seg; published figures use 10 or 4.
    pub step: NonZeroUsize,
    /// How counterparts are found.
    pub association: Association,
}

impl Default for Options {
    /// Step 10, by time.
    fn default() -> Self {
        Self {
            step: NonZeroUsize::MIN.saturating_add(9),
            association: Association::default(),
        }
    }
}

/// All metrics of one estimate against its truth. `Display` is a small table; `{:#}` adds a line for each length.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Evaluation {
    /// How much of the trajectories was compared.
    pub coverage: Coverage,
    /// Axes that ran the other way.
    pub axes: Axes,
    /// Length of the truth over the matched poses, m.
    pub path_m: f64,
    /// Length of the estimate over the matched poses, m. Noise makes paths longer.
    pub estimated_path_m: f64,
    /// Drift over 100 to 800 m; `None` for a shorter path or a truth without heading.
    pub kitti: Option<Kitti>,
    /// Absolute error after alignment.
    pub ate: Ate,
    /// Shape of segments of 100 to 800 m; `None` for a shorter path.
    pub seg: Option<Seg>,
    /// How far off the last pose is; `None` for a truth without heading.
    pub end: Option<EndError>,
    /// Errors of single motions; `None` for a truth without heading.
    pub rpe: Option<Rpe>,
    /// What was compared, the estimate in the truth's handedness but not aligned; for plots, not serialised.
    #[serde(skip)]
    pub matched: MatchedPoses,
}

/// Judges `estimate` by `truth`.
///
/// # Errors
/// See [`associate()`]. A path too short for KITTI is no error: the evaluation then holds per-pair figures and says so.
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
