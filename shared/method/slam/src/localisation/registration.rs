//! The registration of a scan with a submap of the map.

use gyre_geometry::{Pose, UncertainMotion};
use gyre_scan_matching::{
    ConfigError, KeyframeAligner, MaskedCorrelation, MotionMatch, RefinementConfig, RotationMatch,
    Submap, TranslationConfig, TranslationSearch,
};
use ndarray::Array2;

use crate::localisation::{LocaliserOptions, sight::Sight};

/// Cells a side of the rasters, and their size: 102 m to each side.
const RASTER_CELLS: usize = 255;
const CELL_M: f64 = 0.8;
/// Cells within this range of both sensors are correlated: farther away few points are extracted.
const RANGE_M: f64 = 80.0;
const PLANNED: &str = "rasters have the shape that the searches are planned for";

/// Registers a scan with submaps.
///
/// Planned once; nothing is allocated afterwards.
pub(crate) struct Registration {
    translation: TranslationSearch,
    aligner: KeyframeAligner,
    correlation: MaskedCorrelation,
    sight: Sight,
    scan: Array2<f32>,
    place: Array2<f32>,
    variance_scale: f64,
}

impl Registration {
    /// Plans registrations of scans of at most `capacity` points.
    pub fn new(
        options: &LocaliserOptions,
        refinement: &RefinementConfig,
        capacity: usize,
    ) -> Result<Self, ConfigError> {
        let translation = TranslationConfig {
            reach_m: options.search_reach_m,
            ..TranslationConfig::default()
        };
        let raster = || Array2::zeros((RASTER_CELLS, RASTER_CELLS));
        Ok(Self {
            translation: TranslationSearch::new(RASTER_CELLS, CELL_M, &translation)?,
            aligner: KeyframeAligner::new(refinement, capacity)?,
            correlation: MaskedCorrelation::new(RASTER_CELLS, CELL_M, RANGE_M)?,
            sight: Sight::new(RASTER_CELLS),
            scan: raster(),
            place: raster(),
            variance_scale: options.variance_scale,
        })
    }

    /// Takes the scan that is registered from now on.
    pub fn set_scan(&mut self, scan: &Submap) {
        draw(scan, &mut self.scan);
        self.sight.look(scan);
    }

    /// Takes the submap that it is registered with.
    pub fn set_place(&mut self, place: &Submap) {
        draw(place, &mut self.place);
    }

    /// Searches for the translation, if the scan's yaw in the submap's frame is `yaw_rad`.
    pub fn search(&mut self, yaw_rad: f64) -> MotionMatch {
        let rotation = RotationMatch {
            angle_rad: yaw_rad,
            variance_rad2: 0.0,
            score: 1.0,
            runner_up: None,
        };
        let (scan, place) = (self.scan.view(), self.place.view());
        self.translation
            .search_seen(scan, place, self.sight.seen(), &rotation)
            .expect(PLANNED)
    }

    /// Aligns the scan from an initial guess within some metres: its pose in the submap's frame,
    /// and the masked correlation there; `None` if its points do not determine it.
    pub fn align(
        &mut self,
        scan: &Submap,
        place: &Submap,
        initial: &Pose,
    ) -> Option<(UncertainMotion, f64)> {
        let mut motion = self.aligner.align_to_submap(scan, place, initial)?;
        motion.covariance *= self.variance_scale;
        let rasters = (self.scan.view(), self.place.view());
        let seen = self.sight.seen();
        let correlation = self
            .correlation
            .at(rasters.0, rasters.1, seen, &motion.motion);
        Some((motion, correlation.expect(PLANNED)))
    }
}

/// Draws the root of a submap's weights: a few strong scatterers would outweigh all others.
fn draw(submap: &Submap, raster: &mut Array2<f32>) {
    submap.draw(CELL_M, raster.view_mut()).expect(PLANNED);
    raster.mapv_inplace(f32::sqrt);
}
