use gyre_geometry::{Pose, UncertainMotion};
use nalgebra::Vector2;

use super::{
    DeskewedPoints, RefinementConfig, Submap, alignment::align, local_map::LocalMap,
    registration::COARSE_STRIDE, uncertainty,
};
use crate::SettingError;

/// Initial guesses come from a search on coarse cells, so more iterations are allowed than from
/// scan to scan.
const ITERATIONS: usize = 20;

/// Aligns the middle keyframes of two submaps, with the points of these two scans alone: laid
/// together by odometry, the neighbours in the submaps would carry its errors into the result.
#[derive(Debug)]
pub struct KeyframeAligner {
    config: RefinementConfig,
    map: LocalMap,
    /// The points for the coarse map.
    thinned: DeskewedPoints,
}

impl KeyframeAligner {
    /// Plans alignments of scans of at most `capacity` points. Of `config` count the cells and
    /// reach of the map, and the scales of the covariance.
    pub fn new(config: &RefinementConfig, capacity: usize) -> Result<Self, SettingError> {
        let config = RefinementConfig {
            keyframes: 1,
            ..config.clone()
        };
        config.validate()?;
        Ok(Self {
            map: LocalMap::new(&config),
            config,
            thinned: DeskewedPoints::with_capacity(capacity),
        })
    }

    /// Returns the pose of the later keyframe in the earlier one's frame, from an initial guess;
    /// `None` if the points do not determine it. `whole` takes all points of the earlier submap:
    /// where its keyframes lie better to each other than one scan measures.
    pub fn align(
        &mut self,
        later: &Submap,
        earlier: &Submap,
        whole: bool,
        initial: &Pose,
    ) -> Option<UncertainMotion> {
        let (points, earlier) = match whole {
            true => (&later.keyframe, &earlier.all),
            false => (&later.keyframe, &earlier.keyframe),
        };
        self.map.clear();
        self.map
            .insert(0, earlier, &Pose::identity(), Vector2::zeros());
        self.thinned.clear();
        self.thinned.extend(points, &Pose::identity());
        self.thinned.thin(COARSE_STRIDE);
        let coarse = align(&self.map.coarse(), &self.thinned, initial, ITERATIONS, None);
        let fine = align(&self.map.fine(), points, &coarse.pose, ITERATIONS, None);
        let covariance = uncertainty::of_alignment(&fine, points, &Pose::identity(), &self.config)?;
        Some(UncertainMotion {
            motion: fine.pose,
            covariance,
        })
    }
}
