//! The decoupled search: the rotation, then the translation.

use gyre_scan_matching::{
    ConfigError, JointMatch, RotationConfig, SequentialRotation, TranslationConfig,
    TranslationSearch,
};

use crate::{OdometryError, Pair, Search};

/// Finds the rotation between two scans from their Fourier magnitudes, and then the translation by
/// one correlation (Weston et al., Sec. III-C).
pub struct DecoupledSearch {
    rotation: SequentialRotation,
    translation: TranslationSearch,
}

impl DecoupledSearch {
    /// Plans both searches for rasters of `n` x `n` cells.
    ///
    /// # Errors
    /// The first setting out of its bounds.
    pub fn new(
        n: usize,
        cell_m: f64,
        rotation: &RotationConfig,
        translation: &TranslationConfig,
    ) -> Result<Self, ConfigError> {
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
        let rotation = self.rotation.next(pair.seq(), later, earlier, changed)?; // Eq. 7
        let (Some(rotation), Some(earlier)) = (rotation, earlier) else {
            return Ok(None);
        };
        let motion = self.translation.search(later, earlier, &rotation)?; // Eq. 8
        Ok(Some(JointMatch { rotation, motion }))
    }
}
