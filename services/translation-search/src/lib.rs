//! Finds the translation between consecutive scans once their rotation is known (Weston et al., Eq. 8).

use gyre_messages::{Masked, Motion, MotionEstimate, Pair, Refinement, Rotation, RotationEstimate};
use gyre_radar::raster::RasterConfig;
use gyre_scan_matching::{ConfigError, ShapeError, TranslationConfig, TranslationSearch, square};
use gyre_stage::{
    Launch, Stage, StageError, Statistics,
    inputs::{Joined, JoinedView},
    stage,
    writer::Draft,
};

/// The stage's name.
pub const NAME: &str = "translation-search";

/// Runs the stage until it is told to stop.
pub fn run(launch: &Launch) -> Result<Statistics, StageError> {
    let raster: RasterConfig = launch.section("raster")?;
    let translation: TranslationConfig = launch.section("translation")?;
    let mut search = Translations::new(&raster, &translation)
        .map_err(|e| StageError::Configuration(e.to_string()))?;
    stage::run(launch, &mut search)
}

/// Motions of consecutive scans whose rotation is known.
pub struct Translations {
    search: TranslationSearch,
    n: usize,
}

impl Translations {
    /// Plans the search.
    pub fn new(raster: &RasterConfig, config: &TranslationConfig) -> Result<Self, ConfigError> {
        Ok(Self {
            search: TranslationSearch::new(raster.n, raster.cell_m.into(), config)?,
            n: raster.n,
        })
    }

    /// The motion from the earlier scan to the later one; all zero where the chain starts.
    pub fn next(
        &mut self,
        pair: Pair<'_>,
        rotation: RotationEstimate,
    ) -> Result<MotionEstimate, ShapeError> {
        let Some(earlier) = pair.earlier else {
            return Ok(MotionEstimate::default());
        };
        let later = square("later raster", pair.later, self.n)?;
        let earlier = square("earlier raster", earlier, self.n)?;
        let found = self.search.search(later, earlier, &searched(&rotation))?;
        let c = &found.covariance;
        Ok(MotionEstimate {
            x_m: found.x_m,
            y_m: found.y_m,
            yaw_rad: found.yaw_rad,
            covariance: [
                c[(0, 0)],
                c[(0, 1)],
                c[(0, 2)],
                c[(1, 1)],
                c[(1, 2)],
                c[(2, 2)],
            ],
            interval_ns: 0,
            score: found.score,
            runner_up_score: found.runner_up.map_or(0.0, |runner_up| runner_up.score),
            rotation,
            searched: [found.x_m, found.y_m, found.yaw_rad],
            refinement: Refinement::default(),
        })
    }
}

impl Stage for Translations {
    type Inputs = Joined<Masked, Rotation>;
    type Output = Motion;
    const HOP: gyre_messages::Stage = gyre_messages::Stage::TranslationSearch;

    fn process(
        &mut self,
        input: JoinedView<'_, Masked, Rotation>,
        output: &mut Draft<Motion>,
    ) -> Result<(), StageError> {
        let current = input.current;
        let before = input
            .before
            .map(|before| (before.header(), before.values()));
        let pair = current.header().pair(current.values(), before);
        let pair = pair.ok_or_else(|| current.malformed("its rasters do not fit their headers"))?;
        let motion = self.next(pair, input.other.header().rotation);
        let motion = motion.map_err(|error| current.malformed(error.to_string()))?;
        let interval_ns = input.before.map_or(0, |before| {
            current
                .item()
                .stamp_ns
                .saturating_sub(before.item().stamp_ns)
        });
        output.header().motion = MotionEstimate {
            interval_ns,
            ..motion
        };
        Ok(())
    }
}

fn searched(rotation: &RotationEstimate) -> gyre_scan_matching::RotationMatch {
    gyre_scan_matching::RotationMatch {
        angle_rad: rotation.angle_rad,
        variance_rad2: rotation.variance_rad2,
        score: rotation.score,
        runner_up: None,
    }
}
