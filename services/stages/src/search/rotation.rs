//! The rotation-search stage: the rotation between consecutive scans from their magnitude spectra
//! (Weston et al., Sec. III-C, step 1). [`SequentialRotation`] is the library; this module gives it
//! the rasters of `masked`, and writes its result to `rotation`.

use gyre_contract::{Masked, Rotation, StageId, run::StageCounters};
use gyre_matching::{RotationConfig, RotationMatch, SequentialRotation};
use gyre_radar::raster::RasterConfig;
use gyre_stage::{
    Launch, Stage,
    inputs::{PairView, Pairs},
    stage,
};
use gyre_transport::{RunError, writer::Draft};

use crate::estimates;

/// Finds the rotation between two scans; `None` where the chain of motions starts.
pub type Search = Box<dyn FnMut(&PairView<'_, Masked>) -> Result<Option<RotationMatch>, RunError>>;

pub fn run(launch: &Launch) -> Result<StageCounters, RunError> {
    let raster: RasterConfig = launch.section("raster")?;
    let config: RotationConfig = launch.section("rotation")?;
    let mut rotation = SequentialRotation::new(raster.n, &config).map_err(RunError::input)?;
    // The search keeps the spectrum of the later scan for the next pair, so it needs the number of
    // the scan. A turn measured by the gyro limits the angles that it tries.
    let search = move |input: &PairView<'_, Masked>| {
        let (seq, pair) = (input.current.item().seq, input.rasters()?);
        let turn = input.current.header().turn_rad();
        rotation
            .next(seq, pair.later, pair.earlier, pair.earlier_changed, turn)
            .map_err(|error| input.current.malformed(error.to_string()))
    };
    run_with(launch, Box::new(search))
}

/// Runs the stage until SIGTERM with any search, also one of your own.
pub fn run_with(launch: &Launch, search: Search) -> Result<StageCounters, RunError> {
    stage::run(launch, &mut RotationStage { search })
}

struct RotationStage {
    search: Search,
}

impl Stage for RotationStage {
    type Inputs = Pairs<Masked>;
    type Output = Rotation;
    const HOP: StageId = StageId::RotationSearch;

    fn process(
        &mut self,
        input: PairView<'_, Masked>,
        output: &mut Draft<Rotation>,
    ) -> Result<(), RunError> {
        let found = (self.search)(&input)?;
        output.header().rotation = found.as_ref().map(estimates::rotation).unwrap_or_default();
        Ok(())
    }
}
