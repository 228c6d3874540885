//! Rasterises each scan, undoes its sweep's distortion, masks what would mislead the search, and picks the sparse points out.
//!
//! Reading order: [`Masker`], then `rasters` (what comes before any network), `learned` and [`network`] (the network's masks),
//! `points`; [`model`] and [`runtime`] say which networks there are and who computes them.

mod config;
mod learned;
pub mod model;
pub mod network;
mod points;
mod rasters;
pub mod runtime;

#[cfg(test)]
mod tests;

use std::time::Duration;

use gyre_geometry::{SparsePoint, Twist};
use gyre_messages::{Masked, MaskedHeader, SearchedMotion, mask_kind};
use gyre_radar::{
    PointExtractor, PointsConfig, PointsError, PolarScan, ScanError,
    raster::{RasterConfig, RasterError},
};
use gyre_stage::{
    Launch, Stage, StageError, Statistics,
    reader::Received,
    scans::{ScanView, Scans},
    stage,
    writer::Draft,
};
use thiserror::Error;

pub use config::{MaskKind, MaskingConfig, MaskingConfigError, Provider};
pub use rasters::Sweep;

use learned::Learned;
use network::NetworkError;
use points::Frame;
use rasters::Rasters;

/// The stage's name.
pub const NAME: &str = "masking";

/// Runs the stage until it is told to stop.
pub fn run(launch: &Launch) -> Result<Statistics, StageError> {
    let raster: RasterConfig = launch.section("raster")?;
    let points: PointsConfig = launch.section("points")?;
    let masking: MaskingConfig = launch.section("masking")?;
    let mut masker = Masker::new(&raster, &points, &masking)
        .map_err(|error| StageError::Configuration(error.to_string()))?;
    stage::run(launch, &mut masker)
}

/// Makes masked rasters and sparse points of scans. Both start above the same floor. What a mask makes of a return is its
/// factor: on the power in a raster's cell, on the weight of a point.
pub struct Masker {
    raster: RasterConfig,
    config: MaskingConfig,
    rasters: Rasters,
    learned: Option<Learned>,
    points: PointExtractor,
}

/// Settings that nothing can be masked with.
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
    /// No raster can be made of it.
    #[error(transparent)]
    Raster(#[from] RasterError),
    /// The network failed.
    #[error(transparent)]
    Network(#[from] NetworkError),
}

impl Masker {
    /// Plans the rasters and the points, and loads the network if there is to be one.
    ///
    /// # Errors
    /// The first setting that is out of its bounds; a network that cannot be used.
    pub fn new(
        raster: &RasterConfig,
        points: &PointsConfig,
        config: &MaskingConfig,
    ) -> Result<Self, MaskerError> {
        let learned = match config.kind {
            MaskKind::Learned => Some(Learned::load(config, raster)?),
            MaskKind::None | MaskKind::Threshold => None,
        };
        Ok(Self {
            raster: raster.clone(),
            config: config.clone(),
            rasters: Rasters::new(raster, config)?,
            learned,
            points: PointExtractor::new(points)?,
        })
    }

    /// Rasters that come of each scan: 1, or 2 where a network looks at two scans.
    pub fn rasters(&self) -> usize {
        self.learned.as_ref().map_or(1, Learned::scans)
    }

    /// Masks one scan into the start of `out`, row 0 far ahead. A network that looks at two scans needs the one `before`, of
    /// which there is none where the chain of motions starts, and its raster for this pair comes next in `out`, at
    /// [`MaskedHeader::raster_values`]. Returns the velocity that the sweep's distortion was undone with.
    ///
    /// # Errors
    /// A scan that contradicts itself, no room for a raster, a network that fails.
    pub fn mask(
        &mut self,
        sweep: &Sweep<'_>,
        before: Option<&Sweep<'_>>,
        out: &mut [f32],
    ) -> Result<Option<Twist>, MaskError> {
        let (cells, actual) = (self.raster.n * self.raster.n, out.len());
        match (&mut self.learned, out.get_mut(..cells)) {
            (_, None) => Err(RasterError::Shape {
                n: self.raster.n,
                actual: [1, actual],
            }
            .into()),
            (None, Some(raster)) => Ok(self.rasters.make(sweep, raster)?),
            (Some(learned), Some(_)) => learned.mask(&mut self.rasters, sweep, before, out),
        }
    }

    /// Writes the scan's points to the start of `out`, and returns how many there are: see [`PointExtractor::extract`]. A
    /// network's mask weighs them by [`MaskingConfig::point_exponent`]: that of the scan that [`Masker::mask`] had last,
    /// compensated by `twist`.
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
        if let Some(learned) = self
            .learned
            .as_ref()
            .filter(|_| self.config.point_exponent > 0.0)
        {
            self.frame(twist).weigh(
                learned.mask_of_scan(),
                self.config.point_exponent,
                &mut out[..count],
            );
        }
        Ok(count)
    }

    /// What the network made of the scan that [`Masker::mask`] had last: `n * n` factors from 0 to 1, and behind them, where it
    /// looks at two scans, those of the scan before. `None` without a network.
    pub fn factors(&self) -> Option<&[f32]> {
        self.learned.as_ref().map(Learned::masks)
    }

    /// The cell of a raster compensated by `twist` that a point of the scan lies in, row by row; `None` outside of the raster.
    pub fn cell_of(&self, point: &SparsePoint, twist: Option<Twist>) -> Option<usize> {
        self.frame(twist).cell_of(point)
    }

    fn frame(&self, twist: Option<Twist>) -> Frame {
        let RasterConfig { n, cell_m, .. } = self.raster;
        Frame {
            n,
            cell_m,
            twist,
            doppler_undone: self.config.undo_doppler,
        }
    }

    fn write_header(&self, header: &mut MaskedHeader, twist: Option<Twist>, points: usize) {
        header.points = points as u32;
        header.n = self.raster.n as u32;
        header.rasters = self.rasters() as u32;
        header.cell_m = self.raster.cell_m;
        header.mask = match self.config.kind {
            MaskKind::None => mask_kind::NONE,
            MaskKind::Threshold => mask_kind::THRESHOLD,
            MaskKind::Learned => mask_kind::LEARNED,
        };
        header.compensated = twist.is_some().into();
        header.twist = twist.map_or([0.0; 3], |t| {
            [t.vx_mps as f32, t.vy_mps as f32, t.yaw_rate_radps as f32]
        });
    }
}

impl Stage for Masker {
    type Inputs = Scans;
    type Output = Masked;
    const HOP: gyre_messages::Stage = gyre_messages::Stage::Masking;

    fn process(
        &mut self,
        input: ScanView<'_>,
        output: &mut Draft<Masked>,
    ) -> Result<(), StageError> {
        let sweep = sweep_of(input.scan, input.motion)?;
        let before = input
            .before
            .map(|before| sweep_of(before.scan, before.motion))
            .transpose()?;
        let (header, values) = output.parts::<f32>();
        let cells = self.raster.n * self.raster.n;
        let (rasters, points) =
            values.split_at_mut(self.rasters() * MaskedHeader::raster_values(cells));
        let twist = self.mask(&sweep, before.as_ref(), rasters);
        let twist = twist.map_err(|e| input.scan.malformed(e.to_string()))?;
        let points = self.points(&sweep.scan, twist, MaskedHeader::points_mut(points));
        let points = points.map_err(|e| input.scan.malformed(e.to_string()))?;
        self.write_header(header, twist, points);
        if self.config.stress_delay_ms > 0 {
            std::thread::sleep(Duration::from_millis(self.config.stress_delay_ms));
        }
        Ok(())
    }
}

fn sweep_of(
    received: &Received<gyre_messages::Scan>,
    motion: Option<SearchedMotion>,
) -> Result<Sweep<'_>, StageError> {
    let scan = received.header().view(received.values());
    let scan =
        scan.ok_or_else(|| received.malformed("its payload is shorter than its header says"))?;
    Ok(Sweep {
        number: received.item().scan,
        scan,
        motion,
    })
}
