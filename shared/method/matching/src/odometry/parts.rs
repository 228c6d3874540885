use gyre_masking::Masker;

use crate::{
    ExhaustiveSearch, RefinementKind, Refiner,
    odometry::{DecoupledSearch, OdometryConfig, Search, SearchKind, SetupError},
};

/// The parts that an [`Odometry`](crate::odometry::Odometry) is composed of. Each part comes from
/// the configuration. [`Masker::with_function`] has a mask of your own, and
/// `examples/own_search.rs` replaces the search.
pub struct Parts {
    pub masker: Masker,
    pub search: Box<dyn Search>,
    /// Refines the searched motion; `None`: it is the result.
    pub refiner: Option<Refiner>,
}

impl Parts {
    pub fn new(config: &OdometryConfig) -> Result<Self, SetupError> {
        Ok(Self {
            masker: Masker::new(&config.raster, &config.points, &config.masking)?,
            refiner: refiner(config)?,
            search: search(config)?,
        })
    }
}

fn search(config: &OdometryConfig) -> Result<Box<dyn Search>, SetupError> {
    let (n, cell_m) = (config.raster.n, config.raster.cell_m.into());
    Ok(match config.search.kind {
        SearchKind::Decoupled => Box::new(DecoupledSearch::new(
            n,
            cell_m,
            &config.rotation,
            &config.translation,
        )?),
        SearchKind::Exhaustive => Box::new(ExhaustiveSearch::new(n, cell_m, &config.exhaustive)?),
    })
}

fn refiner(config: &OdometryConfig) -> Result<Option<Refiner>, SetupError> {
    let capacity = config.points.capacity;
    match config.refinement.kind {
        RefinementKind::None => Ok(None),
        RefinementKind::LocalMap if capacity == 0 => Err(SetupError::NoPoints),
        RefinementKind::LocalMap => {
            let (config, sensors) = (&config.refinement, &config.sensors);
            Ok(Some(Refiner::new(config, sensors, capacity)?))
        }
    }
}
