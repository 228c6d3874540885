//! Rasters before any network: above the floor, and with the sweep's distortion undone.

use gyre_geometry::Twist;
use gyre_messages::SearchedMotion;
use gyre_radar::{
    PolarScan,
    raster::{RasterConfig, RasterError, Rasteriser},
};
use nalgebra::{Isometry2, Vector2};
use ndarray::ArrayViewMut2;

use crate::MaskingConfig;

/// A scan, and the motion that its sweep's distortion is undone with.
#[derive(Clone, Copy, Debug)]
pub struct Sweep<'a> {
    /// The scan's place in the recording, or the sensor's own count.
    pub number: u64,
    /// The scan.
    pub scan: PolarScan<'a>,
    /// The motion; `None` where none is known.
    pub motion: Option<SearchedMotion>,
}

/// Makes rasters of sweeps.
#[derive(Debug)]
pub(crate) struct Rasters {
    rasteriser: Rasteriser,
    floor: u8,
    compensate: bool,
    undo_doppler: bool,
}

impl Rasters {
    pub fn new(raster: &RasterConfig, masking: &MaskingConfig) -> Result<Self, RasterError> {
        Ok(Self {
            rasteriser: Rasteriser::new(raster)?,
            floor: masking.floor(),
            compensate: masking.compensate,
            undo_doppler: masking.undo_doppler,
        })
    }

    /// Writes the raster to `cells`, row 0 far ahead. Returns the velocity that the distortion was undone with.
    pub fn make(
        &mut self,
        sweep: &Sweep<'_>,
        cells: &mut [f32],
    ) -> Result<Option<Twist>, RasterError> {
        let n = self.rasteriser.config().n;
        let actual = [1, cells.len()];
        let mut raster = ArrayViewMut2::from_shape((n, n), cells)
            .map_err(|_| RasterError::Shape { n, actual })?;
        let mut scan = sweep.scan;
        if !self.undo_doppler {
            scan.geometry.doppler_s = 0.0;
        }
        if let Some(twist) = sweep.motion.filter(|_| self.compensate).map(twist_of) {
            match self
                .rasteriser
                .rasterise(&scan, self.floor, Some(twist), raster.view_mut())
            {
                Ok(()) => return Ok(Some(twist)),
                // A motion that no vehicle makes is a wrong match: better no compensation than that.
                Err(RasterError::Twist { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        self.rasteriser.rasterise(&scan, self.floor, None, raster)?;
        Ok(None)
    }
}

fn twist_of(motion: SearchedMotion) -> Twist {
    let pose = Isometry2::new(Vector2::new(motion.x_m, motion.y_m), motion.yaw_rad);
    Twist::from_motion(&pose, motion.interval_ns as f64 * 1e-9)
}
