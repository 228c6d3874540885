//! Rasterises and masks scans, and extracts their sparse points.
//!
//! Reading order: [`Masker`]; `compensation` (motion-compensated rasters above the threshold);
//! `learned` and [`network`] (masks of a network); `points` (weights of sparse points); [`model`]
//! (networks and their cards), [`Library`] (what computes them) and [`runtime`] (the search for
//! ONNX Runtime).

pub mod backend;
mod compensation;
mod config;
mod error;
mod external;
mod learned;
mod library;
pub mod model;
pub mod network;
mod points;
mod resolve;
pub mod runtime;
mod sweep;

#[cfg(test)]
mod tests;

use gyre_geometry::{SparsePoint, Twist};
use gyre_radar::{PointExtractor, PointsConfig, PolarScan, ScanError, raster::RasterConfig};
use ndarray::{ArrayView2, ArrayViewMut2};

pub use backend::{Backend, Provider};
pub use config::{MaskKind, MaskingConfig, MaskingConfigError};
pub use error::{MaskError, MaskerError};
pub use library::Library;
pub use sweep::Sweep;

use compensation::CompensatedRaster;
use learned::LearnedMask;
use points::RasterFrame;

/// Makes masked rasters and sparse points from scans, both above the same power threshold. The mask
/// is a factor for each cell of a raster. Raised to [`MaskingConfig::point_exponent`], it is also a
/// factor of the weights of the cell's points.
#[derive(Debug)]
pub struct Masker {
    raster: RasterConfig,
    config: MaskingConfig,
    rasters: CompensatedRaster,
    learned: Option<LearnedMask>,
    points: PointExtractor,
}

impl Masker {
    /// Allocates all buffers and loads the network, if there is one.
    ///
    /// # Errors
    /// The first setting out of its bounds; a network that cannot be used.
    pub fn new(
        raster: &RasterConfig,
        points: &PointsConfig,
        config: &MaskingConfig,
    ) -> Result<Self, MaskerError> {
        config.validate()?;
        let learned = match config.kind {
            MaskKind::Learned => Some(LearnedMask::load(config, raster)?),
            MaskKind::None | MaskKind::Threshold => None,
        };
        Ok(Self {
            raster: raster.clone(),
            config: config.clone(),
            rasters: CompensatedRaster::new(raster, config)?,
            learned,
            points: PointExtractor::new(points)?,
        })
    }

    /// Returns the number of scans that the mask takes and of the rasters that it gives: 1, or 2
    /// (the scan and the previous one).
    pub fn scans(&self) -> usize {
        self.learned.as_ref().map_or(1, LearnedMask::scans)
    }

    /// Returns whether [`Masker::mask`] accepts a scan that follows this one: always if the mask
    /// takes one scan, else if this one was masked or [set](Masker::set_previous) last.
    pub fn can_follow(&self, number: u64) -> bool {
        self.learned
            .as_ref()
            .is_none_or(|learned| learned.can_follow(number))
    }

    /// Rasterises a scan as the previous one of the next, to resume after a restart.
    ///
    /// # Errors
    /// As [`Masker::mask`].
    pub fn set_previous(&mut self, sweep: &Sweep<'_>) -> Result<(), MaskError> {
        match &mut self.learned {
            Some(learned) => learned.set_previous(&mut self.rasters, sweep),
            None => Ok(()),
        }
    }

    /// Masks a scan into `later` (n x n, row 0 far ahead). If the mask takes two scans, the
    /// previous scan that this one `follows`, masked for this pair, goes into `earlier`; a scan
    /// that follows none is its own previous scan. Returns the velocity that was used for motion
    /// compensation.
    ///
    /// # Errors
    /// An inconsistent scan, rasters of another shape, a network that fails, or a previous scan
    /// that this one [cannot follow](Masker::can_follow).
    pub fn mask(
        &mut self,
        sweep: &Sweep<'_>,
        follows: Option<u64>,
        later: ArrayViewMut2<'_, f32>,
        earlier: Option<ArrayViewMut2<'_, f32>>,
    ) -> Result<Option<Twist>, MaskError> {
        match &mut self.learned {
            None => Ok(self.rasters.make(sweep, later)?),
            Some(learned) => learned.mask(&mut self.rasters, sweep, follows, later, earlier),
        }
    }

    /// Writes the scan's points to the start of `out` and returns their number: see
    /// [`PointExtractor::extract`]. The mask of a network, which is that of the last masked scan
    /// with compensation by `twist`, is applied with [`MaskingConfig::point_exponent`].
    ///
    /// # Errors
    /// An inconsistent scan.
    pub fn points(
        &mut self,
        scan: &PolarScan<'_>,
        twist: Option<Twist>,
        out: &mut [SparsePoint],
    ) -> Result<usize, ScanError> {
        let count = self.points.extract(scan, self.config.floor(), out)?;
        let exponent = self.config.point_exponent;
        if let Some(mask) = self.factors(0).filter(|_| exponent > 0.0) {
            self.frame(twist).weight(mask, exponent, &mut out[..count]);
        }
        Ok(count)
    }

    /// Returns the network's factors from 0 to 1, n x n, of the last masked scan (0) or of its
    /// previous one (1, if the mask takes two). `None` without a network.
    pub fn factors(&self, scan: usize) -> Option<ArrayView2<'_, f32>> {
        self.learned.as_ref()?.factors(scan)
    }

    /// Returns the cell (row, column) of a point in a raster that is compensated by `twist`; `None`
    /// outside of the raster.
    pub fn cell_of(&self, point: &SparsePoint, twist: Option<Twist>) -> Option<[usize; 2]> {
        self.frame(twist).cell_of(point)
    }

    fn frame(&self, twist: Option<Twist>) -> RasterFrame {
        let RasterConfig { n, cell_m, .. } = self.raster;
        RasterFrame {
            n,
            cell_m,
            twist,
            doppler_compensated: self.config.undo_doppler,
        }
    }
}
