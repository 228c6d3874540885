//! The part of the summary about loops.

use std::fmt;

use serde::Serialize;

/// The counts of loops in the summary.
#[derive(Debug, Serialize)]
pub struct SlamSummary {
    /// Keyframes.
    pub keyframes: usize,
    /// Loops that the corrected trajectory is made with.
    pub loops_used: usize,
    /// Verified loops that contradict odometry or other loops.
    pub loops_rejected: usize,
    /// ATE of the corrected trajectory, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ate_m: Option<f64>,
}

impl fmt::Display for SlamSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self {
            keyframes,
            loops_used,
            loops_rejected,
            ate_m,
        } = self;
        write!(
            f,
            "slam          {loops_used} loops between {keyframes} keyframes, {loops_rejected} rejected"
        )?;
        match ate_m {
            Some(ate_m) => write!(f, "; ATE after correction {ate_m:.3} m rmse"),
            None => Ok(()),
        }
    }
}
