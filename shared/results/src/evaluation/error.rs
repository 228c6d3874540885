//! Errors of an evaluation's input.

#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct EvaluationError(pub(crate) String);

pub(crate) const ESTIMATE: &str = "estimate";
pub(crate) const TRUTH: &str = "ground truth";

/// The largest coordinate of a position, m: map projections stay far below.
pub(crate) const LARGEST_COORDINATE_M: f64 = 1e9;

impl EvaluationError {
    pub(crate) fn too_few(matched: usize, [estimate, truth]: [usize; 2]) -> Self {
        Self(format!(
            "{matched} of {estimate} estimated poses could be associated with the {truth} poses of the ground truth; at least 2 are needed"
        ))
    }
}
