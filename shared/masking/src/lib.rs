//! Rasterises scans, masks what would mislead the search, and extracts the sparse points.
//!
//! Reading order: [`Masker`]; `compensation` (a motion-compensated raster above the threshold); `learned` and [`network`]
//! (masks of a network); `points` (weights of sparse points); [`model`] and [`runtime`] (which networks there are, and the
//! library that computes them).

mod compensation;
mod config;
mod learned;
pub mod model;
pub mod network;
mod points;
pub mod runtime;

#[cfg(test)]
mod tests;

use gyre_geometry::{SparsePoint, Twist};
use gyre_radar::{
    PointExtractor, PointsConfig, PointsError, PolarScan, ScanError,
    raster::{RasterConfig, RasterError},
};
use ndarray::{ArrayView2, ArrayViewMut2};
use thiserror::Error;

pub use config::{MaskKind, MaskingConfig, MaskingConfigError, Provider};

use compensation::CompensatedRaster;
use learned::LearnedMask;
use network::NetworkError;
use points::RasterFrame;

/// A scan, and the velocity that its sweep is motion-compensated with.
#[derive(Clone, Copy, Debug)]
pub struct Sweep<'a> {
    /// The scan's number; consecutive calls tell scans apart by it.
    pub number: u64,
    /// The scan.
    pub scan: PolarScan<'a>,
    /// The sensor's velocity; `None` where it is unknown.
    pub twist: Option<Twist>,
}

/// Makes masked rasters and sparse points of scans. Both start above the same power threshold. The mask's factor of a cell
/// multiplies the power in a raster, and by [`MaskingConfig::point_exponent`] the weight of a point.
#[derive(Debug)]
pub struct Masker {
    raster: RasterConfig,
    config: MaskingConfig,
    rasters: CompensatedRaster,
    learned: Option<LearnedMask>,
    points: PointExtractor,
}

/// Settings that no masker can be built from.
#[derive(Debug, Error)]
pub enum MaskerError {
    /// The rasters'.
    #[error(transparent)]
    Raster(#[from] RasterError),
    /// The points'.
    #[error(transparent)]
    Points(#[from] PointsError),
    /// The network's.
    #[error(transparent)]
    Network(#[from] NetworkError),
}

/// Why a scan cannot be masked.
#[derive(Debug, Error)]
pub enum MaskError {
    /// The scan cannot be rasterised.
    #[error(transparent)]
    Raster(#[from] RasterError),
    /// The network failed.
    #[error(transparent)]
    Network(#[from] NetworkError),
    /// The mask looks at two scans, and the one before is neither remembered nor has it a place in the output.
    #[error(
        "the mask looks at two scans, but scan {0} is not remembered or there is no room for its raster"
    )]
    ScanBefore(u64),
}

impl Masker {
    /// Plans the rasters and the points, and loads the network if there is one.
    ///
    /// # Errors
    /// The first setting that is out of its bounds; a network that cannot be used.
    pub fn new(
        raster: &RasterConfig,
        points: &PointsConfig,
        config: &MaskingConfig,
    ) -> Result<Self, MaskerError> {
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

    /// Scans that the mask looks at, and rasters that it makes of them: 1, or 2 (the scan and the one before).
    pub fn scans(&self) -> usize {
        self.learned.as_ref().map_or(1, LearnedMask::scans)
    }

    /// Whether a scan may follow this one: always where the mask looks at each scan alone, else if this scan was masked or
    /// remembered last.
    pub fn remembers(&self, number: u64) -> bool {
        self.learned
            .as_ref()
            .is_none_or(|learned| learned.remembers(number))
    }

    /// Rasterises a scan that others follow, as [`Masker::mask`] did before a restart.
    ///
    /// # Errors
    /// As [`Masker::mask`].
    pub fn remember(&mut self, sweep: &Sweep<'_>) -> Result<(), MaskError> {
        match &mut self.learned {
            Some(learned) => learned.remember(&mut self.rasters, sweep),
            None => Ok(()),
        }
    }

    /// Masks a scan into `later` (n x n, row 0 far ahead). Where the mask looks at two scans, the raster of the scan that
    /// this one `follows`, as this pair's mask leaves it, goes into `earlier`; a scan that follows none is its own scan
    /// before. Returns the velocity that the sweep was motion-compensated with.
    ///
    /// # Errors
    /// A scan that contradicts itself, rasters of another shape, a network that fails, a scan before that is not
    /// [remembered](Masker::remembers).
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

    /// Writes the scan's points to the start of `out`, and returns how many there are: see [`PointExtractor::extract`]. A
    /// network's mask weighs them by [`MaskingConfig::point_exponent`]: that of the scan that was masked last, compensated
    /// by `twist`.
    ///
    /// # Errors
    /// A scan that contradicts itself.
    pub fn points(
        &mut self,
        scan: &PolarScan<'_>,
        twist: Option<Twist>,
        out: &mut [SparsePoint],
    ) -> Result<usize, ScanError> {
        let count = self.points.extract(scan, self.config.floor(), out)?;
        let exponent = self.config.point_exponent;
        if let Some(mask) = self.factors(0).filter(|_| exponent > 0.0) {
            self.frame(twist).weigh(mask, exponent, &mut out[..count]);
        }
        Ok(count)
    }

    /// The network's factors from 0 to 1, n x n, of the scan that was masked last (0) or of the scan before it (1, where
    /// the mask looks at two). `None` without a network.
    pub fn factors(&self, scan: usize) -> Option<ArrayView2<'_, f32>> {
        self.learned.as_ref()?.factors(scan)
    }

    /// The cell (row, column) of a raster compensated by `twist` that a point of the scan lies in; `None` outside of the
    /// raster.
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
