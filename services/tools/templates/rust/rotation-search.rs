//! A search for the rotation between two scans.

use std::process::ExitCode;

use gyre_matching::{RotationConfig, SequentialRotation};
use gyre_stage::RunError;
use gyre_stages::search::rotation;

fn main() -> ExitCode {
    gyre_stage::launch::main("rotation-search", |launch| {
        let raster: gyre_radar::RasterConfig = launch.section("raster")?;
        // Gyre's own search, to be replaced by yours.
        let config: RotationConfig = launch.section("rotation")?;
        let mut search = SequentialRotation::new(raster.n, &config)
            .map_err(|error| RunError::Input(error.to_string()))?;
        rotation::run_with(
            launch,
            Box::new(move |scans| {
                // Views of shared memory: n x n, row 0 far ahead.
                let (seq, pair) = (scans.current.item().seq, scans.rasters()?);
                let turn = scans.current.header().turn_rad();
                search
                    .next(seq, pair.later, pair.earlier, pair.earlier_changed, turn)
                    .map_err(|error| scans.current.malformed(error.to_string()))
            }),
        )
    })
}
