//! The registration of two submaps: search, alignment and correlation.

use gyre_geometry::Pose;
use gyre_matching::{
    KeyframeAligner, MaskedCorrelation, MotionMatch, RefinementConfig, RotationMatch, SettingError,
    Submap, TranslationConfig, TranslationSearch,
};
use ndarray::{Array2, ArrayView2};

use super::{CELL_M, PLANNED, RASTER_CELLS};

/// Cells within this range of both sensors are correlated: farther away few points are extracted.
const MASK_M: f64 = 80.0;
/// Largest translation between two places, along each axis, m.
const REACH_M: f64 = 25.0;

/// Registers a later submap with an earlier one. Planned once.
///
/// `seen` is 1 in the cells that the later sensor could see, and 0 elsewhere; `None` if it could
/// see all.
pub struct Registrar {
    pub aligner: KeyframeAligner,
    translation: TranslationSearch,
    correlation: MaskedCorrelation,
    later: Array2<f32>,
    earlier: Array2<f32>,
}

impl Registrar {
    /// Plans registrations of keyframes of at most `capacity` points. `refinement` is the
    /// refinement of the odometry: its cells and reach, and the scales of its covariance.
    pub fn new(refinement: &RefinementConfig, capacity: usize) -> Result<Self, SettingError> {
        let translation = TranslationConfig {
            reach_m: REACH_M,
            ..TranslationConfig::default()
        };
        let raster = || Array2::zeros((RASTER_CELLS, RASTER_CELLS));
        Ok(Self {
            aligner: KeyframeAligner::new(refinement, capacity)?,
            translation: TranslationSearch::new(RASTER_CELLS, CELL_M, &translation)?,
            correlation: MaskedCorrelation::new(RASTER_CELLS, CELL_M, MASK_M)?,
            later: raster(),
            earlier: raster(),
        })
    }

    pub const CELLS: usize = RASTER_CELLS;

    pub fn set_later(&mut self, submap: &Submap) {
        draw(submap, &mut self.later);
    }

    pub fn set_earlier(&mut self, submap: &Submap) {
        draw(submap, &mut self.earlier);
    }

    /// Searches for the translation, if the later submap's yaw in the earlier one's frame is this.
    pub fn search(&mut self, angle_rad: f64, seen: Option<ArrayView2<'_, f32>>) -> MotionMatch {
        let rotation = RotationMatch {
            angle_rad,
            variance_rad2: 0.0,
            score: 1.0,
            runner_up: None,
        };
        let (later, earlier) = (self.later.view(), self.earlier.view());
        self.translation
            .search_seen(later, earlier, seen, &rotation)
            .expect(PLANNED)
    }

    pub fn correlation(&mut self, motion: &Pose, seen: Option<ArrayView2<'_, f32>>) -> f64 {
        let (later, earlier) = (self.later.view(), self.earlier.view());
        self.correlation
            .at(later, earlier, seen, motion)
            .expect(PLANNED)
    }
}

/// Draws the root of a submap's weights: a few strong scatterers would outweigh all others.
fn draw(submap: &Submap, raster: &mut Array2<f32>) {
    submap.draw(CELL_M, raster);
    raster.mapv_inplace(f32::sqrt);
}
