//! The translation-search stage: the translation between consecutive scans once their rotation is
//! known (Weston et al., Eq. 8).

use gyre_messages::{Masked, Motion, MotionEstimate, Rotation, StageId};
use gyre_radar::raster::RasterConfig;
use gyre_scan_matching::{TranslationConfig, TranslationSearch};
use gyre_stage::{
    Launch, Stage, StageCounters, StageError,
    inputs::{Joined, JoinedView},
    stage,
    writer::Draft,
};

/// Runs the stage until SIGTERM.
///
/// # Errors
/// An invalid configuration, or an error of [`stage::run`].
pub fn run(launch: &Launch) -> Result<StageCounters, StageError> {
    let raster: RasterConfig = launch.section("raster")?;
    let config: TranslationConfig = launch.section("translation")?;
    let search = TranslationSearch::new(raster.n, raster.cell_m.into(), &config)
        .map_err(|error| StageError::Configuration(error.to_string()))?;
    stage::run(launch, &mut TranslationStage { search })
}

struct TranslationStage {
    search: TranslationSearch,
}

impl Stage for TranslationStage {
    type Inputs = Joined<Masked, Rotation>;
    type Output = Motion;
    const HOP: StageId = StageId::TranslationSearch;

    fn process(
        &mut self,
        input: JoinedView<'_, Masked, Rotation>,
        output: &mut Draft<Motion>,
    ) -> Result<(), StageError> {
        let (pair, rotation) = (input.pair.rasters()?, input.other.header().rotation);
        let found = pair
            .earlier
            .map(|earlier| self.search.search(pair.later, earlier, &rotation.into()))
            .transpose()
            .map_err(|error| input.pair.current.malformed(error.to_string()))?;
        output.header().motion = found.map_or_else(MotionEstimate::default, |found| {
            MotionEstimate::from_search(&found, rotation, input.pair.interval_ns())
        });
        Ok(())
    }
}
