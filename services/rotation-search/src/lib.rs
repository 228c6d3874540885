//! Finds the rotation between consecutive scans from their magnitude spectra (Weston et al., Sec. III-C, step 1).

use gyre_messages::{Masked, Pair, Rotation, RotationEstimate};
use gyre_radar::raster::RasterConfig;
use gyre_scan_matching::{ConfigError, RotationConfig, SequentialRotation, ShapeError, square};
use gyre_stage::{
    Launch, Stage, StageError, Statistics,
    inputs::{PairView, Pairs},
    stage,
    writer::Draft,
};

/// The stage's name.
pub const NAME: &str = "rotation-search";

/// Runs the stage until it is told to stop.
pub fn run(launch: &Launch) -> Result<Statistics, StageError> {
    let raster: RasterConfig = launch.section("raster")?;
    let rotation: RotationConfig = launch.section("rotation")?;
    let mut search = Rotations::new(raster.n, &rotation)
        .map_err(|e| StageError::Configuration(e.to_string()))?;
    stage::run(launch, &mut search)
}

/// Rotations of consecutive scans; each scan's spectrum is computed once and kept for the next pair.
pub struct Rotations {
    search: SequentialRotation,
    n: usize,
}

impl Rotations {
    /// Plans the search for rasters of `n` x `n` cells.
    pub fn new(n: usize, config: &RotationConfig) -> Result<Self, ConfigError> {
        let search = SequentialRotation::new(n, config)?;
        Ok(Self { search, n })
    }

    /// The rotation of scan `seq` against the one before; all zero where the chain starts.
    pub fn next(
        &mut self,
        seq: u64,
        pair: Pair<'_>,
        own_masks: bool,
    ) -> Result<RotationEstimate, ShapeError> {
        let later = square("later raster", pair.later, self.n)?;
        let earlier = pair
            .earlier
            .map(|cells| square("earlier raster", cells, self.n));
        let found = self
            .search
            .next(seq, later, earlier.transpose()?, own_masks)?;
        Ok(found.as_ref().map_or_else(RotationEstimate::default, wire))
    }
}

impl Stage for Rotations {
    type Inputs = Pairs<Masked>;
    type Output = Rotation;
    const HOP: gyre_messages::Stage = gyre_messages::Stage::RotationSearch;

    fn process(
        &mut self,
        input: PairView<'_, Masked>,
        output: &mut Draft<Rotation>,
    ) -> Result<(), StageError> {
        let (current, header) = (input.current, input.current.header());
        let before = input
            .before
            .map(|before| (before.header(), before.values()));
        let pair = header.pair(current.values(), before);
        let pair = pair.ok_or_else(|| current.malformed("its rasters do not fit their headers"))?;
        let rotation = self.next(header.item.seq, pair, header.rasters == 2);
        output.header().rotation =
            rotation.map_err(|error| current.malformed(error.to_string()))?;
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
