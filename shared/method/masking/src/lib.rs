//! Rasterises and masks scans, and extracts their sparse points.

pub mod backend;
mod compensation;
mod config;
mod error;
mod function;
mod learned;
pub mod model;
pub mod network;
pub mod networks;
mod points;
mod resolve;
mod sweep;

#[cfg(test)]
mod tests;

use gyre_geometry::{PolarScan, ScanError, SparsePoint, Twist};
use gyre_radar::{PointExtractor, PointsConfig, raster::RasterConfig};
use ndarray::{ArrayView2, ArrayViewMut2};

pub use backend::{Backend, Provider};
pub use config::{MaskKind, MaskingConfig, MaskingConfigError};
pub use error::{MaskError, MaskerError};
pub use function::{Factors, MaskFunction};
pub use sweep::Sweep;

use compensation::CompensatedRaster;
use function::AppliedFunction;
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
    weights: Weights,
    points: PointExtractor,
}

#[derive(Debug)]
enum Weights {
    None,
    Network(LearnedMask),
    Function(AppliedFunction),
}

impl Masker {
    pub fn new(
        raster: &RasterConfig,
        points: &PointsConfig,
        config: &MaskingConfig,
    ) -> Result<Self, MaskerError> {
        config.validate()?;
        let weights = match config.kind {
            MaskKind::Learned => Weights::Network(LearnedMask::load(config, raster)?),
            MaskKind::None | MaskKind::Threshold => Weights::None,
        };
        Self::with_weights(raster, points, config, weights)
    }

    /// Allocates all buffers for a mask of your own, in the place of a network: no other is loaded.
    pub fn with_function(
        raster: &RasterConfig,
        points: &PointsConfig,
        config: &MaskingConfig,
        function: Box<dyn MaskFunction>,
    ) -> Result<Self, MaskerError> {
        config.validate()?;
        let weights = Weights::Function(AppliedFunction::new(function));
        Self::with_weights(raster, points, config, weights)
    }

    fn with_weights(
        raster: &RasterConfig,
        points: &PointsConfig,
        config: &MaskingConfig,
        weights: Weights,
    ) -> Result<Self, MaskerError> {
        Ok(Self {
            raster: raster.clone(),
            config: config.clone(),
            rasters: CompensatedRaster::new(raster, config)?,
            weights,
            points: PointExtractor::new(points)?,
        })
    }

    /// Returns the number of scans that the mask takes and of the rasters that it gives: 1, or 2
    /// (the scan and the previous one).
    pub fn scans(&self) -> usize {
        self.network().map_or(1, LearnedMask::scans)
    }

    /// Returns whether [`Masker::mask`] accepts a scan that follows this one: always if the mask
    /// takes one scan, else if this one was masked or [set](Masker::set_previous) last.
    pub fn can_follow(&self, number: u64) -> bool {
        self.network()
            .is_none_or(|network| network.can_follow(number))
    }

    /// Rasterises a scan as the previous one of the next, to resume after a restart.
    pub fn set_previous(&mut self, sweep: &Sweep<'_>) -> Result<(), MaskError> {
        match &mut self.weights {
            Weights::Network(network) => network.set_previous(&mut self.rasters, sweep),
            Weights::None | Weights::Function(_) => Ok(()),
        }
    }

    /// Masks a scan into `later` (n x n, row 0 far ahead). If the mask takes two scans, the
    /// previous scan that this one `follows`, masked for this pair, is written to `earlier`; a scan
    /// without a predecessor is its own previous scan. Returns the velocity that was used for
    /// motion compensation. Fails if the scan [cannot follow](Masker::can_follow) the previous
    /// scan.
    pub fn mask(
        &mut self,
        sweep: &Sweep<'_>,
        follows: Option<u64>,
        later: ArrayViewMut2<'_, f32>,
        earlier: Option<ArrayViewMut2<'_, f32>>,
    ) -> Result<Option<Twist>, MaskError> {
        let rasters = &mut self.rasters;
        match &mut self.weights {
            Weights::None => Ok(rasters.make(sweep, later)?),
            Weights::Network(network) => network.mask(rasters, sweep, follows, later, earlier),
            Weights::Function(function) => function.mask(rasters, sweep, later),
        }
    }

    /// Writes the scan's points to the start of `out` and returns their number: see
    /// [`PointExtractor::extract`]. The scan is the one that was masked last, with compensation by
    /// `twist`. Factors of its raster are applied with [`MaskingConfig::point_exponent`].
    pub fn points(
        &mut self,
        scan: &PolarScan<'_>,
        twist: Option<Twist>,
        out: &mut [SparsePoint],
    ) -> Result<usize, ScanError> {
        let scan = match &self.weights {
            Weights::Function(function) => &function.left(scan),
            Weights::None | Weights::Network(_) => scan,
        };
        let count = self.points.extract(scan, self.config.floor(), out)?;
        let exponent = self.config.point_exponent;
        if let Some(mask) = self.factors(0).filter(|_| exponent > 0.0) {
            self.frame(twist).weight(mask, exponent, &mut out[..count]);
        }
        Ok(count)
    }

    /// Returns the factors from 0 to 1, n x n, of the raster of the last masked scan (0) or of its
    /// previous one (1, if the mask takes two). `None` without a network or a function.
    pub fn factors(&self, scan: usize) -> Option<ArrayView2<'_, f32>> {
        match &self.weights {
            Weights::Network(network) => network.factors(scan),
            Weights::Function(function) => function.factors().filter(|_| scan == 0),
            Weights::None => None,
        }
    }

    fn network(&self) -> Option<&LearnedMask> {
        match &self.weights {
            Weights::Network(network) => Some(network),
            Weights::None | Weights::Function(_) => None,
        }
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
