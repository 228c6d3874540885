use std::fmt;

use crate::estimation::{CHI_SQUARE_99_9, Constraint};

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoopVerdict {
    Used,
    /// It contradicts the odometry between its keyframes; in the filter, the estimate.
    ContradictsOdometry,
    ContradictsLoops,
    /// The group has been counted in full (filter alone).
    Redundant,
}

impl fmt::Display for LoopVerdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Used => "used",
            Self::ContradictsOdometry => "contradicts odometry",
            Self::ContradictsLoops => "contradicts loops",
            Self::Redundant => "redundant",
        })
    }
}

/// A loop that was accepted by the [`LoopCloser`](crate::LoopCloser), and what became of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct JudgedLoop {
    pub constraint: Constraint,
    /// Chi-square against the odometry between its keyframes. The filter does not use it: it tests
    /// against the estimate.
    pub chi_square: f64,
    pub verdict: LoopVerdict,
    /// The kernel's weight in the graph, 0 to 1; 0 if the loop is not used.
    pub weight: f64,
    /// True if the standing estimate is made with it.
    pub(crate) is_taken: bool,
}

impl JudgedLoop {
    /// A loop that was tested against the odometry, and is part of no estimate.
    pub(crate) fn new(constraint: Constraint, chi_square: f64) -> Self {
        let mut judged = Self {
            constraint,
            chi_square,
            verdict: LoopVerdict::Used,
            weight: 0.0,
            is_taken: false,
        };
        judged.judge_by_odometry();
        judged
    }

    pub(crate) fn judge_by_odometry(&mut self) {
        self.verdict = match self.chi_square <= CHI_SQUARE_99_9 {
            true => LoopVerdict::Used,
            false => LoopVerdict::ContradictsOdometry,
        };
    }

    pub(crate) fn is_used(&self) -> bool {
        self.verdict == LoopVerdict::Used
    }
}
