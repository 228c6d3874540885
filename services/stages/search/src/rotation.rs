//! The rotation-search stage: the rotation between consecutive scans from their magnitude spectra
//! (Weston et al., Sec. III-C, step 1).

use gyre_messages::{Masked, Rotation, RotationEstimate, StageId};
use gyre_radar::raster::RasterConfig;
use gyre_scan_matching::{RotationConfig, SequentialRotation};
use gyre_stage::{
    Launch, Stage, StageCounters, StageError,
    inputs::{PairView, Pairs},
    stage,
    writer::Draft,
};

/// Runs the stage until SIGTERM.
///
/// # Errors
/// An invalid configuration, or an error of [`stage::run`].
pub fn run(launch: &Launch) -> Result<StageCounters, StageError> {
    let raster: RasterConfig = launch.section("raster")?;
    let config: RotationConfig = launch.section("rotation")?;
    let rotation = SequentialRotation::new(raster.n, &config)
        .map_err(|error| StageError::Configuration(error.to_string()))?;
    stage::run(launch, &mut RotationStage { rotation })
}

struct RotationStage {
    rotation: SequentialRotation,
}

impl Stage for RotationStage {
    type Inputs = Pairs<Masked>;
    type Output = Rotation;
    const HOP: StageId = StageId::RotationSearch;

    fn process(
        &mut self,
        input: PairView<'_, Masked>,
        output: &mut Draft<Rotation>,
    ) -> Result<(), StageError> {
        let (seq, pair) = (input.current.item().seq, input.rasters()?);
        let found = self
            .rotation
            .next(seq, pair.later, pair.earlier, pair.earlier_changed)
            .map_err(|error| input.current.malformed(error.to_string()))?;
        output.header().rotation = found
            .as_ref()
            .map(RotationEstimate::from)
            .unwrap_or_default();
        Ok(())
    }
}
