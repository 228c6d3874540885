use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::config::{Overlap, Peak};

/// Configuration of [`ExhaustiveSearch`](crate::ExhaustiveSearch): section `[exhaustive]`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct ExhaustiveConfig {
    /// Largest angle searched to either side, degrees.
    #[serde(skip)]
    pub reach_deg: f64,
    /// Step between angles, degrees. The cost grows with its inverse.
    #[serde(skip)]
    pub step_deg: f64,
    /// Largest shift searched along each axis, m.
    #[serde(skip)]
    pub reach_m: f64,
    /// Normalisation for the shrinking overlap. `none` compares the angles by their plain
    /// correlations, as in MbyM: rotation blurs, so unrotated rasters have the advantage. `energy`
    /// compares correlation coefficients.
    pub overlap: Overlap,
    /// Interpolation of the peak between angles and between cells.
    pub peak: Peak,
}

impl Default for ExhaustiveConfig {
    fn default() -> Self {
        Self {
            reach_deg: 15.0,
            step_deg: 1.0,
            reach_m: 12.0,
            overlap: Overlap::default(),
            peak: Peak::default(),
        }
    }
}

impl ExhaustiveConfig {
    pub fn candidates(&self) -> usize {
        self.angles().count
    }

    pub(super) fn angles(&self) -> AngleGrid {
        let (reach, step) = (self.reach_deg.to_radians(), self.step_deg.to_radians());
        let side = (reach / step + 1e-9).floor();
        AngleGrid {
            first: -side * step,
            step,
            count: 2 * side as usize + 1,
        }
    }
}

/// Evenly spaced angles about zero, radians.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct AngleGrid {
    first: f64,
    pub step: f64,
    pub count: usize,
}

impl AngleGrid {
    /// The angle `k` steps from the first one; `k` need not be whole.
    pub fn angle(&self, k: f64) -> f64 {
        self.first + k * self.step
    }

    /// The angle `by` steps from the k-th; at the ends of the grid the last one again.
    pub fn beside(&self, k: usize, by: isize) -> usize {
        (k as isize + by).clamp(0, self.count as isize - 1) as usize
    }

    pub fn is_inner(&self, k: usize) -> bool {
        k > 0 && k + 1 < self.count
    }

    pub fn are_close(&self, a: usize, b: usize) -> bool {
        (-1..=1).any(|by| self.beside(a, by) == b)
    }

    /// Variance of a uniform distribution over the grid.
    pub fn guess(&self) -> f64 {
        (0.5 * self.step * self.count as f64).powi(2) / 3.0
    }
}
