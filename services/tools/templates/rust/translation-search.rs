//! A search for the translation between two scans whose rotation is known.

use std::process::ExitCode;

use gyre_matching::{TranslationConfig, TranslationSearch};
use gyre_stage::RunError;
use gyre_stages::search::translation;

fn main() -> ExitCode {
    gyre_stage::launch::main("translation-search", |launch| {
        let raster: gyre_radar::RasterConfig = launch.section("raster")?;
        // Gyre's own search, to be replaced by yours.
        let config: TranslationConfig = launch.section("translation")?;
        let mut search = TranslationSearch::new(raster.n, raster.cell_m.into(), &config)
            .map_err(|error| RunError::Input(error.to_string()))?;
        translation::run_with(
            launch,
            Box::new(move |scans, rotation| {
                // Views of shared memory: n x n, row 0 far ahead.
                let pair = scans.rasters()?;
                pair.earlier
                    .map(|earlier| search.search(pair.later, earlier, rotation))
                    .transpose()
                    .map_err(|error| scans.current.malformed(error.to_string()))
            }),
        )
    })
}
