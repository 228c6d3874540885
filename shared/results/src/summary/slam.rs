//! The part of the summary about loops.

use crate::evaluation::LoopErrors;
use serde::Serialize;

#[derive(Debug, Default, Serialize)]
pub struct SlamSummary {
    pub keyframes: usize,
    pub loops_used: usize,
    /// Verified loops that contradict odometry or other loops.
    pub loops_rejected: usize,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub odometry: Option<LoopErrors>,
    /// The same loops against the ground truth: where it contradicts them much more than odometry
    /// does, it is the ground truth that is wrong.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ground_truth: Option<LoopErrors>,
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ate_m: Option<f64>,
}
