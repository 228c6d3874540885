//! Finds rotation and translation between consecutive scans together, by trying every angle (Masking by Moving; `raw` in
//! Weston et al., Table III). It stands in for both halves of the decoupled search.

use gyre_messages::{Masked, Motion, MotionEstimate, Pair, Refinement, RotationEstimate};
use gyre_radar::raster::RasterConfig;
use gyre_scan_matching::{ConfigError, ExhaustiveConfig, ExhaustiveSearch, ShapeError, square};
use gyre_stage::{
    Launch, Stage, StageError, Statistics,
    inputs::{PairView, Pairs},
    stage,
    writer::Draft,
};

/// The stage's name.
pub const NAME: &str = "joint-search";

/// Runs the stage until it is told to stop.
pub fn run(launch: &Launch) -> Result<Statistics, StageError> {
    let raster: RasterConfig = launch.section("raster")?;
    let exhaustive: ExhaustiveConfig = launch.section("exhaustive")?;
    let mut search =
        Motions::new(&raster, &exhaustive).map_err(|e| StageError::Configuration(e.to_string()))?;
    stage::run(launch, &mut search)
}

/// Motions of consecutive scans.
pub struct Motions {
    search: ExhaustiveSearch,
    n: usize,
}

impl Motions {
    /// Plans the search.
    pub fn new(raster: &RasterConfig, config: &ExhaustiveConfig) -> Result<Self, ConfigError> {
        Ok(Self {
            search: ExhaustiveSearch::new(raster.n, raster.cell_m.into(), config)?,
            n: raster.n,
        })
    }

    /// The motion from the earlier scan to the later one; all zero where the chain starts.
    pub fn next(&mut self, pair: Pair<'_>) -> Result<MotionEstimate, ShapeError> {
        let Some(earlier) = pair.earlier else {
            return Ok(MotionEstimate::default());
        };
        let later = square("later raster", pair.later, self.n)?;
        let earlier = square("earlier raster", earlier, self.n)?;
        let found = self.search.search(later, earlier)?;
        let (motion, c) = (&found.motion, &found.motion.covariance);
        Ok(MotionEstimate {
            x_m: motion.x_m,
            y_m: motion.y_m,
            yaw_rad: motion.yaw_rad,
            covariance: [
                c[(0, 0)],
                c[(0, 1)],
                c[(0, 2)],
                c[(1, 1)],
                c[(1, 2)],
                c[(2, 2)],
            ],
            interval_ns: 0,
            score: motion.score,
            runner_up_score: motion.runner_up.map_or(0.0, |runner_up| runner_up.score),
            rotation: wire(&found.rotation),
            searched: [motion.x_m, motion.y_m, motion.yaw_rad],
            refinement: Refinement::default(),
        })
    }
}

impl Stage for Motions {
    type Inputs = Pairs<Masked>;
    type Output = Motion;
    const HOP: gyre_messages::Stage = gyre_messages::Stage::JointSearch;

    fn process(
        &mut self,
        input: PairView<'_, Masked>,
        output: &mut Draft<Motion>,
    ) -> Result<(), StageError> {
        let current = input.current;
        let before = input
            .before
            .map(|before| (before.header(), before.values()));
        let pair = current.header().pair(current.values(), before);
        let pair = pair.ok_or_else(|| current.malformed("its rasters do not fit their headers"))?;
        let motion = self
            .next(pair)
            .map_err(|error| current.malformed(error.to_string()))?;
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

fn wire(found: &gyre_scan_matching::RotationMatch) -> RotationEstimate {
    RotationEstimate {
        angle_rad: found.angle_rad,
        variance_rad2: found.variance_rad2,
        score: found.score,
        runner_up_rad: found.runner_up.map_or(0.0, |runner_up| runner_up.angle_rad),
        runner_up_score: found.runner_up.map_or(0.0, |runner_up| runner_up.score),
    }
}
