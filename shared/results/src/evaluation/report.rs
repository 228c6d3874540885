//! The whole evaluation: associate, convert the handedness, compute the metrics.

use std::num::NonZeroUsize;

use gyre_geometry::Pose;
use gyre_radar::Trajectory;
use serde::Serialize;

use crate::evaluation::{
    Ate, Axes, Coverage, EndError, EvaluationError, Kitti, MatchedPoses, Rpe, Seg, associate, ate,
    end_error, handedness::resolve_axes, kitti, mounting::heading_offset_rad, rpe, seg,
};

/// Poses from the start of a segment of KITTI and seg to the start of the next; published figures
/// use 10 or 4.
pub const STEP: NonZeroUsize = NonZeroUsize::MIN.saturating_add(9);

/// All metrics of one estimate. `Display` is a short table; `{:#}` adds a line for each segment
/// length.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Evaluation {
    pub coverage: Coverage,
    pub axes: Axes,
    /// Heading of the estimate minus heading of the ground truth, degrees, if all differ by one
    /// large angle: then the sensors are mounted differently, and metrics that use headings are
    /// invalid.
    pub heading_offset_deg: Option<f64>,
    /// Path length of the ground truth over the matched poses, m.
    pub path_m: f64,
    /// Path length of the estimate over the matched poses, m. Noise makes it longer.
    pub estimated_path_m: f64,
    /// The ground truth stays in one place although the estimate moves: it is empty, or of another
    /// drive.
    pub truth_stands: bool,
    /// KITTI odometry errors; `None` for a path up to 100 m or a trajectory without heading.
    pub kitti: Option<Kitti>,
    pub ate: Ate,
    /// Segment error; `None` for a path up to 100 m.
    pub seg: Option<Seg>,
    /// End-point error; `None` for a trajectory without heading.
    pub end: Option<EndError>,
    /// Relative pose error; `None` for a trajectory without heading.
    pub rpe: Option<Rpe>,
    /// The poses that were compared, the estimate in the handedness of the ground truth but not
    /// aligned; not serialised.
    #[serde(skip)]
    pub matched: MatchedPoses,
}

/// Compares `estimate` with `truth`, by segments that start at every `step`-th pose.
///
/// A path that is too short for KITTI is not an error.
pub fn evaluate(
    estimate: &Trajectory,
    truth: &Trajectory,
    step: NonZeroUsize,
) -> Result<Evaluation, EvaluationError> {
    let (matched, coverage) = associate(estimate, truth)?;
    let (matched, axes) = resolve_axes(matched);
    let has_heading = axes.without_heading().is_none();
    let ate = ate(&matched);
    let (moved_m, travelled_m) = (extent_m(matched.truth()), extent_m(matched.estimate()));
    let offset_rad = heading_offset_rad(&matched, &ate.truth_from_estimate)
        .filter(|_| has_heading && moved_m.min(travelled_m) > ALIGNED_M);
    Ok(Evaluation {
        coverage,
        axes,
        heading_offset_deg: offset_rad.map(f64::to_degrees),
        path_m: crate::evaluation::matched::path_m(matched.truth()),
        estimated_path_m: crate::evaluation::matched::path_m(matched.estimate()),
        truth_stands: moved_m < STANDING_M && travelled_m > MOVING_M,
        kitti: has_heading.then(|| kitti(&matched, step)).flatten(),
        ate,
        seg: seg(&matched, step),
        end: has_heading.then(|| end_error(&matched)),
        rpe: has_heading.then(|| rpe(&matched)),
        matched,
    })
}

/// Positions within this distance of the first are in one place, m.
const STANDING_M: f64 = 0.1;
/// An estimate that leaves this distance moves, m.
const MOVING_M: f64 = 0.5;
/// Paths that are longer define the rotation of their alignment, m.
const ALIGNED_M: f64 = 5.0;

/// Returns the largest distance from the first position, m.
fn extent_m(poses: &[Pose]) -> f64 {
    let Some(first) = poses.first() else {
        return 0.0;
    };
    let distance = |pose: &Pose| (pose.translation.vector - first.translation.vector).norm();
    poses.iter().map(distance).fold(0.0, f64::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use gyre_geometry::pose;

    fn evaluated(estimate: &[Pose], truth: &[Pose]) -> Evaluation {
        let [estimate, truth] = [estimate, truth].map(|poses| Trajectory::untimed(poses.to_vec()));
        evaluate(&estimate, &truth, STEP).unwrap()
    }

    #[test]
    fn a_ground_truth_that_stands_still_is_named() {
        let drive: Vec<_> = (0..40).map(|k| pose(f64::from(k), 0.0, 0.0)).collect();
        let zeros = vec![pose(0.0, 0.0, 0.0); 40];
        let found = evaluated(&drive, &zeros);
        assert!(found.truth_stands && found.to_string().contains("stands still"));
        for (estimate, truth) in [(&drive, &drive), (&zeros, &zeros), (&zeros, &drive)] {
            let found = evaluated(estimate, truth);
            assert!(!found.truth_stands && !found.to_string().contains("stands still"));
        }
    }
}
