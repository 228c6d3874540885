use gyre_geometry::Twist;
use gyre_radar::raster::{RasterConfig, RasterError, Rasteriser};
use ndarray::ArrayViewMut2;

use crate::{MaskingConfig, Sweep};

#[derive(Debug)]
pub(crate) struct CompensatedRaster {
    rasteriser: Rasteriser,
    floor: u8,
    compensate: bool,
    undo_doppler: bool,
}

impl CompensatedRaster {
    pub fn new(raster: &RasterConfig, masking: &MaskingConfig) -> Result<Self, RasterError> {
        Ok(Self {
            rasteriser: Rasteriser::new(raster)?,
            floor: masking.floor(),
            compensate: masking.compensate,
            undo_doppler: masking.undo_doppler,
        })
    }

    /// Writes the raster to `out` (n x n, row 0 far ahead). Returns the velocity that was used for
    /// motion compensation.
    pub fn make(
        &mut self,
        sweep: &Sweep<'_>,
        mut out: ArrayViewMut2<'_, f32>,
    ) -> Result<Option<Twist>, RasterError> {
        let mut scan = sweep.scan;
        if !self.undo_doppler {
            scan.geometry.doppler_s = 0.0;
        }
        let mut rasterise = |twist| {
            self.rasteriser
                .rasterise(&scan, self.floor, twist, out.view_mut())
                .map(|()| twist)
        };
        match sweep.twist.filter(|_| self.compensate) {
            // An impossible velocity comes from a wrong match: no compensation is better.
            Some(twist) => match rasterise(Some(twist)) {
                Err(RasterError::Twist { .. }) => rasterise(None),
                result => result,
            },
            None => rasterise(None),
        }
    }
}
