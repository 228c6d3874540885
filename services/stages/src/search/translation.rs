//! The translation-search stage: the translation between consecutive scans once their rotation is
//! known (Weston et al., Eq. 8).

use gyre_contract::{Masked, Motion, MotionEstimate, Rotation, StageId, run::StageCounters};
use gyre_matching::{MotionMatch, RotationMatch, TranslationConfig, TranslationSearch};
use gyre_radar::raster::RasterConfig;
use gyre_stage::{
    Launch, Stage,
    inputs::{Joined, JoinedView, PairView},
    stage,
};
use gyre_transport::{RunError, writer::Draft};

use crate::estimates;

/// Finds the motion between two scans whose rotation is known; `None` where the chain of motions
/// starts.
pub type Search =
    Box<dyn FnMut(&PairView<'_, Masked>, &RotationMatch) -> Result<Option<MotionMatch>, RunError>>;

pub fn run(launch: &Launch) -> Result<StageCounters, RunError> {
    let raster: RasterConfig = launch.section("raster")?;
    let config: TranslationConfig = launch.section("translation")?;
    let mut search =
        TranslationSearch::new(raster.n, raster.cell_m.into(), &config).map_err(RunError::input)?;
    let search = move |input: &PairView<'_, Masked>, rotation: &RotationMatch| {
        let pair = input.rasters()?;
        pair.earlier
            .map(|earlier| search.search(pair.later, earlier, rotation))
            .transpose()
            .map_err(|error| input.current.malformed(error.to_string()))
    };
    run_with(launch, Box::new(search))
}

/// Runs the stage until SIGTERM with a search of your own.
pub fn run_with(launch: &Launch, search: Search) -> Result<StageCounters, RunError> {
    stage::run(launch, &mut TranslationStage { search })
}

struct TranslationStage {
    search: Search,
}

impl Stage for TranslationStage {
    type Inputs = Joined<Masked, Rotation>;
    type Output = Motion;
    const HOP: StageId = StageId::TranslationSearch;

    fn process(
        &mut self,
        input: JoinedView<'_, Masked, Rotation>,
        output: &mut Draft<Motion>,
    ) -> Result<(), RunError> {
        let rotation = input.other.header().rotation;
        let found = (self.search)(&input.pair, &estimates::rotation_match(&rotation))?;
        output.header().motion = found.map_or_else(MotionEstimate::default, |found| {
            estimates::searched(&found, rotation, input.pair.interval_ns())
        });
        Ok(())
    }
}
