//! Errors of an evaluation's input.

#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct EvaluationError(pub(crate) String);

pub(crate) const ESTIMATE: &str = "estimate";
pub(crate) const TRUTH: &str = "ground truth";

/// The largest coordinate of a position, m: map projections stay far below.
pub(crate) const LARGEST_COORDINATE_M: f64 = 1e9;
