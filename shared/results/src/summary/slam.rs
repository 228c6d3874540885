//! The part of the summary about loops.

use std::fmt;

use gyre_evaluation::LoopErrors;
use serde::Serialize;

/// The counts of loops in the summary.
#[derive(Debug, Default, Serialize)]
pub struct SlamSummary {
    /// Keyframes.
    pub keyframes: usize,
    /// Loops that the corrected trajectory is made with.
    pub loops_used: usize,
    /// Verified loops that contradict odometry or other loops.
    pub loops_rejected: usize,
    /// The loops that are used against odometry.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub odometry: Option<LoopErrors>,
    /// The same loops against the ground truth: where it contradicts them much more than odometry
    /// does, it is the ground truth that is wrong.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ground_truth: Option<LoopErrors>,
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
            odometry,
            ground_truth,
            ate_m,
        } = self;
        write!(
            f,
            "slam          {loops_used} loops between {keyframes} keyframes, {loops_rejected} rejected"
        )?;
        if let Some(ate_m) = ate_m {
            write!(f, "; ATE after correction {ate_m:.3} m rmse")?;
        }
        for (name, errors) in [("odometry", odometry), ("ground truth", ground_truth)] {
            if let Some(errors) = errors {
                write!(
                    f,
                    "\n              {name} differs from the loops by {:.2} m, {:.2} deg rms",
                    errors.translation_rmse_m, errors.rotation_rmse_deg
                )?;
            }
        }
        Ok(())
    }
}
