use ndarray::ArrayView2;

use crate::{
    PolarSpectrum, RotationConfig, RotationMatch, RotationSearch, SettingError, ShapeError,
};

/// Finds the rotations between consecutive scans. The spectrum of each scan is computed once and
/// kept for the next pair.
pub struct SequentialRotation {
    search: RotationSearch,
    later: PolarSpectrum,
    earlier: PolarSpectrum,
    /// The scan that `earlier` belongs to.
    kept: Option<u64>,
}

impl SequentialRotation {
    pub fn new(n: usize, config: &RotationConfig) -> Result<Self, SettingError> {
        let search = RotationSearch::new(n, config)?;
        let (later, earlier) = (search.new_spectrum(), search.new_spectrum());
        Ok(Self {
            search,
            later,
            earlier,
            kept: None,
        })
    }

    /// Finds the rotation of scan `seq` against the one before; `None` without an earlier raster.
    ///
    /// `earlier_changed`: the earlier raster is not the one that was given as the later one last
    /// time, as with a mask that looks at both scans of a pair. `turn_rad`: the rotation as a gyro
    /// has measured it, near which it is searched.
    pub fn next(
        &mut self,
        seq: u64,
        later: ArrayView2<'_, f32>,
        earlier: Option<ArrayView2<'_, f32>>,
        earlier_changed: bool,
        turn_rad: Option<f64>,
    ) -> Result<Option<RotationMatch>, ShapeError> {
        self.search.spectrum(later, &mut self.later)?;
        let mut rotation = None;
        if let Some(earlier) = earlier {
            // After a restart or a gap the kept spectrum does not belong to the scan before.
            let is_kept = self
                .kept
                .is_some_and(|kept| kept.checked_add(1) == Some(seq));
            if earlier_changed || !is_kept {
                self.search.spectrum(earlier, &mut self.earlier)?;
            }
            rotation = Some(self.search.search(&self.later, &self.earlier, turn_rad)?);
        }
        std::mem::swap(&mut self.later, &mut self.earlier);
        self.kept = Some(seq);
        Ok(rotation)
    }
}
