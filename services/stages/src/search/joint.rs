//! The joint-search stage: an exhaustive search for rotation and translation between consecutive
//! scans over every angle (Masking by Moving; `raw` in Weston et al., Table III). It replaces both
//! stages of the decoupled search.

use gyre_contract::{Masked, Motion, MotionEstimate, StageId, run::StageCounters};
use gyre_matching::{ExhaustiveConfig, ExhaustiveSearch};
use gyre_radar::raster::RasterConfig;
use gyre_stage::{
    Launch, Stage,
    inputs::{PairView, Pairs},
    stage,
};
use gyre_transport::{RunError, writer::Draft};

use crate::estimates;

pub fn run(launch: &Launch) -> Result<StageCounters, RunError> {
    let raster: RasterConfig = launch.section("raster")?;
    let config: ExhaustiveConfig = launch.section("exhaustive")?;
    let search =
        ExhaustiveSearch::new(raster.n, raster.cell_m.into(), &config).map_err(RunError::input)?;
    stage::run(launch, &mut JointStage { search })
}

struct JointStage {
    search: ExhaustiveSearch,
}

impl Stage for JointStage {
    type Inputs = Pairs<Masked>;
    type Output = Motion;
    const HOP: StageId = StageId::JointSearch;

    fn process(
        &mut self,
        input: PairView<'_, Masked>,
        output: &mut Draft<Motion>,
    ) -> Result<(), RunError> {
        let pair = input.rasters()?;
        let found = pair
            .earlier
            .map(|earlier| self.search.search(pair.later, earlier))
            .transpose()
            .map_err(|error| input.current.malformed(error.to_string()))?;
        output.header().motion = found.map_or_else(MotionEstimate::default, |found| {
            let rotation = estimates::rotation(&found.rotation);
            estimates::searched(&found.motion, rotation, input.interval_ns())
        });
        Ok(())
    }
}
