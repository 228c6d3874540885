//! The search of a configuration in one process: for commands that time it or look at what goes in.

use gyre_joint_search::Motions;
use gyre_messages::{MotionEstimate, Pair};
use gyre_rotation_search::Rotations;
use gyre_scan_matching::{ConfigError, ShapeError};
use gyre_translation_search::Translations;

use crate::configuration::{Configuration, SearchKind};

/// From the raster of a scan (the sequence number is the first argument) and that of the scan before to a motion.
pub type Search = Box<dyn FnMut(u64, Pair<'_>) -> Result<MotionEstimate, ShapeError>>;

/// The search of a configuration, as its stages do it between masking and the pose. A scan's spectrum is kept for the next
/// pair, unless the masks look at two scans (`rasters` is 2) and so leave it another raster there.
pub fn search(configuration: &Configuration, rasters: usize) -> Result<Search, ConfigError> {
    let raster = &configuration.raster;
    Ok(match configuration.search.kind {
        SearchKind::Decoupled => {
            let mut rotations = Rotations::new(raster.n, &configuration.rotation)?;
            let mut translations = Translations::new(raster, &configuration.translation)?;
            Box::new(move |seq, pair| {
                translations.next(pair, rotations.next(seq, pair, rasters == 2)?)
            })
        }
        SearchKind::Exhaustive => {
            let mut motions = Motions::new(raster, &configuration.exhaustive)?;
            Box::new(move |_, pair| motions.next(pair))
        }
    })
}
