//! Masks: what makes the rasters and the points of scans.

use gyre_geometry::{SparsePoint, Twist};
use gyre_masking::{Masker, Sweep};
use gyre_radar::PolarScan;
use ndarray::{ArrayView2, ArrayViewMut2};

use crate::OdometryError;

/// Masks scans: makes a raster and sparse points of each.
pub trait Mask: Send + Sync {
    /// Returns the number of scans that the mask takes and of rasters that it fills in: 1, or 2
    /// (the scan and the one before).
    fn scans(&self) -> usize {
        1
    }

    /// Rasterises and masks a scan. Returns the velocity that was used for motion compensation.
    /// On an error the scan is left out.
    fn mask(
        &mut self,
        sweep: &Sweep<'_>,
        rasters: &mut Rasters<'_>,
    ) -> Result<Option<Twist>, OdometryError>;

    /// Writes the scan's points to the start of `out` and returns their number. `twist` is the
    /// velocity that [`Mask::mask`] returned.
    fn points(
        &mut self,
        scan: &PolarScan<'_>,
        twist: Option<Twist>,
        out: &mut [SparsePoint],
    ) -> Result<usize, OdometryError>;

    /// Returns the factors from 0 to 1, n x n, of the last masked scan (0) or of the one before
    /// (1). `None` without factors.
    fn factors(&self, _scan: usize) -> Option<ArrayView2<'_, f32>> {
        None
    }
}

/// The rasters that a mask fills in: n x n, row 0 far ahead.
pub struct Rasters<'a> {
    /// The raster of the scan.
    pub later: ArrayViewMut2<'a, f32>,
    /// The raster of the scan before, masked for this pair, if the mask takes two scans.
    pub earlier: Option<ArrayViewMut2<'a, f32>>,
    /// The number of the scan before; `None` where the chain of motions starts: the scan is then
    /// its own scan before.
    pub follows: Option<u64>,
}

impl Mask for Masker {
    fn scans(&self) -> usize {
        Masker::scans(self)
    }

    fn mask(
        &mut self,
        sweep: &Sweep<'_>,
        rasters: &mut Rasters<'_>,
    ) -> Result<Option<Twist>, OdometryError> {
        let earlier = rasters.earlier.as_mut().map(|raster| raster.view_mut());
        let later = rasters.later.view_mut();
        Ok(Masker::mask(self, sweep, rasters.follows, later, earlier)?)
    }

    fn points(
        &mut self,
        scan: &PolarScan<'_>,
        twist: Option<Twist>,
        out: &mut [SparsePoint],
    ) -> Result<usize, OdometryError> {
        Ok(Masker::points(self, scan, twist, out)?)
    }

    fn factors(&self, scan: usize) -> Option<ArrayView2<'_, f32>> {
        Masker::factors(self, scan)
    }
}
