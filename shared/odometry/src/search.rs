//! The search for the motion between two rasters.

use gyre_scan_matching::{
    ConfigError, ExhaustiveSearch, JointMatch, SequentialRotation, ShapeError, TranslationSearch,
};
use ndarray::ArrayView2;

use crate::{OdometryConfig, SearchKind};

/// Decoupled or exhaustive, as configured.
pub(crate) enum MotionSearch {
    Decoupled {
        rotation: SequentialRotation,
        translation: Box<TranslationSearch>,
    },
    Exhaustive(Box<ExhaustiveSearch>),
}

impl MotionSearch {
    pub fn new(config: &OdometryConfig) -> Result<Self, ConfigError> {
        let (n, cell_m) = (config.raster.n, config.raster.cell_m.into());
        Ok(match config.search.kind {
            SearchKind::Decoupled => Self::Decoupled {
                rotation: SequentialRotation::new(n, &config.rotation)?,
                translation: Box::new(TranslationSearch::new(n, cell_m, &config.translation)?),
            },
            SearchKind::Exhaustive => {
                let search = ExhaustiveSearch::new(n, cell_m, &config.exhaustive)?;
                Self::Exhaustive(Box::new(search))
            }
        })
    }

    /// Finds the motion of scan `seq` against the earlier raster; `None` without one. `earlier_changed`: the earlier raster
    /// is not the one that was the later one last time.
    pub fn find(
        &mut self,
        seq: u64,
        later: ArrayView2<'_, f32>,
        earlier: Option<ArrayView2<'_, f32>>,
        earlier_changed: bool,
    ) -> Result<Option<JointMatch>, ShapeError> {
        match self {
            Self::Decoupled {
                rotation,
                translation,
            } => {
                let rotation = rotation.next(seq, later, earlier, earlier_changed)?;
                let (Some(rotation), Some(earlier)) = (rotation, earlier) else {
                    return Ok(None);
                };
                let motion = translation.search(later, earlier, &rotation)?;
                Ok(Some(JointMatch { rotation, motion }))
            }
            Self::Exhaustive(search) => earlier
                .map(|earlier| search.search(later, earlier))
                .transpose(),
        }
    }
}
