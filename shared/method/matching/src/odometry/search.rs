use crate::{
    ExhaustiveSearch, JointMatch, RotationConfig, SequentialRotation, SettingError,
    TranslationConfig, TranslationSearch,
    odometry::{OdometryError, Pair},
};

pub trait Search: Send + Sync {
    /// Finds the pose of the later scan's frame in the earlier one's; `None` where the chain of
    /// motions starts.
    /// On an error the later scan of the pair is left out.
    fn search(&mut self, pair: &Pair) -> Result<Option<JointMatch>, OdometryError>;
}

/// Finds the rotation between two scans from their Fourier magnitudes, and then the translation by
/// one correlation (Weston et al., Sec. III-C).
pub struct DecoupledSearch {
    rotation: SequentialRotation,
    translation: TranslationSearch,
}

impl DecoupledSearch {
    pub fn new(
        n: usize,
        cell_m: f64,
        rotation: &RotationConfig,
        translation: &TranslationConfig,
    ) -> Result<Self, SettingError> {
        Ok(Self {
            rotation: SequentialRotation::new(n, rotation)?,
            translation: TranslationSearch::new(n, cell_m, translation)?,
        })
    }
}

impl Search for DecoupledSearch {
    fn search(&mut self, pair: &Pair) -> Result<Option<JointMatch>, OdometryError> {
        let (later, earlier) = (pair.later(), pair.earlier());
        let changed = pair.earlier_changed();
        let turn = pair.turn_rad();
        let rotation = self
            .rotation
            .next(pair.seq(), later, earlier, changed, turn)?; // Eq. 7
        let (Some(rotation), Some(earlier)) = (rotation, earlier) else {
            return Ok(None);
        };
        let motion = self.translation.search(later, earlier, &rotation)?; // Eq. 8
        Ok(Some(JointMatch { rotation, motion }))
    }
}

impl Search for ExhaustiveSearch {
    fn search(&mut self, pair: &Pair) -> Result<Option<JointMatch>, OdometryError> {
        let search = |earlier| ExhaustiveSearch::search(self, pair.later(), earlier);
        Ok(pair.earlier().map(search).transpose()?)
    }
}
