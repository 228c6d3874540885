//! The registration of a scan with a submap of the map.

use gyre_geometry::{Pose, UncertainMotion};
use gyre_scan_matching::{
    ConfigError, KeyframeAligner, MaskedCorrelation, MotionMatch, RefinementConfig, RotationMatch,
    Submap, TranslationConfig, TranslationSearch,
};
use ndarray::Array2;

use crate::localisation::sight::Sight;

/// Cells a side of the rasters, and their size: 102 m to each side.
const RASTER_CELLS: usize = 255;
const CELL_M: f64 = 0.8;
/// Cells within this range of both sensors are correlated: farther away few points are extracted.
const RANGE_M: f64 = 80.0;
/// Largest distance of a scan from the keyframe of its place, along each axis, m.
const SEARCH_REACH_M: f64 = 25.0;
/// Factor of the covariance of a registration with the map over a registration with the scans just
/// before.
const VARIANCE_SCALE: f64 = 2.0;
const PLANNED: &str = "rasters have the shape that the searches are planned for";

/// Registers a scan with submaps.
/// Planned once; nothing is allocated afterwards.
pub(crate) struct Registration {
    translation: TranslationSearch,
    aligner: KeyframeAligner,
    correlation: MaskedCorrelation,
    sight: Sight,
    scan: Array2<f32>,
    place: Array2<f32>,
}

impl Registration {
    pub fn new(refinement: &RefinementConfig, capacity: usize) -> Result<Self, ConfigError> {
        let translation = TranslationConfig {
            reach_m: SEARCH_REACH_M,
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
        })
    }

    pub fn set_scan(&mut self, scan: &Submap) {
        draw(scan, &mut self.scan);
        self.sight.look(scan);
    }

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
        let found = match self.sight.seen() {
            Some(seen) => self.translation.search_seen(scan, place, seen, &rotation),
            None => self.translation.search(scan, place, &rotation),
        };
        found.expect(PLANNED)
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
        motion.covariance *= VARIANCE_SCALE;
        let rasters = (self.scan.view(), self.place.view());
        let correlation = match self.sight.seen() {
            Some(seen) => self
                .correlation
                .at_seen(rasters.0, rasters.1, seen, &motion.motion),
            None => self.correlation.at(rasters.0, rasters.1, &motion.motion),
        };
        Some((motion, correlation.expect(PLANNED)))
    }
}

/// Draws the root of a submap's weights: a few strong scatterers would outweigh all others.
fn draw(submap: &Submap, raster: &mut Array2<f32>) {
    submap.draw(CELL_M, raster.view_mut()).expect(PLANNED);
    raster.mapv_inplace(f32::sqrt);
}
