//! Rasterises each scan, undoes its sweep's distortion, masks what would mislead the search, and picks the sparse points out.

mod config;

#[cfg(test)]
mod tests;

use std::time::Duration;

use gyre_messages::{FloatBlock, Masked, SearchedMotion, mask_kind};
use gyre_radar::{
    Point, PointExtractor, PointsConfig, PointsError, PolarScan, ScanError,
    raster::{RasterConfig, RasterError, Rasteriser, Twist},
};
use gyre_stage::{
    Launch, Stage, StageError, Statistics,
    scans::{ScanView, Scans},
    stage,
    writer::Draft,
};
use nalgebra::{Isometry2, Vector2};
use thiserror::Error;

pub use config::{MaskKind, MaskingConfig};

/// The stage's name.
pub const NAME: &str = "masking";

/// Runs the stage until it is told to stop.
pub fn run(launch: &Launch) -> Result<Statistics, StageError> {
    let raster: RasterConfig = launch.section("raster")?;
    let points: PointsConfig = launch.section("points")?;
    let masking: MaskingConfig = launch.section("masking")?;
    let mut masker =
        Masker::new(&raster, &points, &masking).map_err(|error| StageError::Configuration(error.to_string()))?;
    stage::run(launch, &mut masker)
}

/// Makes masked rasters and sparse points of scans. Both start above the same floor. What a mask makes of a return is its
/// factor: on the power in a raster's cell, on the weight of a point.
pub struct Masker {
    raster: RasterConfig,
    config: MaskingConfig,
    rasteriser: Rasteriser,
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
}

impl Masker {
    /// Plans the rasters and the points.
    ///
    /// # Errors
    /// The first setting that is out of its bounds.
    pub fn new(raster: &RasterConfig, points: &PointsConfig, config: &MaskingConfig) -> Result<Self, MaskerError> {
        Ok(Self {
            raster: raster.clone(),
            config: config.clone(),
            rasteriser: Rasteriser::new(raster)?,
            points: PointExtractor::new(points)?,
        })
    }

    /// Masks one scan into `cells`, row 0 far ahead. Returns the velocity that its sweep's distortion was undone with.
    pub fn mask(
        &mut self,
        scan: &PolarScan<'_>,
        motion: Option<&SearchedMotion>,
        cells: &mut [f32],
    ) -> Result<Option<Twist>, RasterError> {
        let floor = self.config.floor();
        let mut scan = *scan;
        if !self.config.undo_doppler {
            scan.geometry.doppler_s = 0.0;
        }
        if let Some(twist) = motion.filter(|_| self.config.compensate).map(twist_of) {
            match self.rasteriser.rasterise(&scan, floor, Some(twist), cells) {
                Ok(()) => return Ok(Some(twist)),
                // A motion that no vehicle makes is a wrong match: better no compensation than that.
                Err(RasterError::Twist { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        self.rasteriser.rasterise(&scan, floor, None, cells)?;
        Ok(None)
    }

    /// Writes the scan's points to the start of `out`, and returns how many there are: see [`PointExtractor::extract`].
    ///
    /// # Errors
    /// A scan that contradicts itself.
    pub fn points(&mut self, scan: &PolarScan<'_>, out: &mut [Point]) -> Result<usize, ScanError> {
        self.points.extract(scan, self.config.floor(), out)
    }
}

impl Stage for Masker {
    type Inputs = Scans;
    type Output = Masked;
    const HOP: gyre_messages::Stage = gyre_messages::Stage::Masking;

    fn process(&mut self, input: ScanView<'_>, output: &mut Draft<Masked>) -> Result<(), StageError> {
        let scan = input.scan.header().view(input.scan.values());
        let scan = scan.ok_or_else(|| input.scan.malformed("its payload is shorter than its header says"))?;
        let (header, values) = output.parts::<f32>();
        let cells = self.raster.n * self.raster.n;
        let (raster, points) = values.split_at_mut(FloatBlock::count(cells) * FloatBlock::LEN);
        let twist = self.mask(&scan, input.motion.as_ref(), &mut raster[..cells]);
        let twist = twist.map_err(|e| input.scan.malformed(e.to_string()))?;
        let points = self.points(&scan, points.as_chunks_mut().0).map_err(|e| input.scan.malformed(e.to_string()))?;
        header.points = points as u32;
        header.n = self.raster.n as u32;
        header.rasters = 1;
        header.cell_m = self.raster.cell_m;
        header.mask = match self.config.kind {
            MaskKind::None => mask_kind::NONE,
            MaskKind::Threshold => mask_kind::THRESHOLD,
        };
        header.compensated = twist.is_some().into();
        header.twist = twist.map_or([0.0; 3], |t| [t.vx_mps as f32, t.vy_mps as f32, t.yaw_rate_radps as f32]);
        if self.config.stress_delay_ms > 0 {
            std::thread::sleep(Duration::from_millis(self.config.stress_delay_ms));
        }
        Ok(())
    }
}

fn twist_of(motion: &SearchedMotion) -> Twist {
    let pose = Isometry2::new(Vector2::new(motion.x_m, motion.y_m), motion.yaw_rad);
    Twist::from_motion(&pose, motion.interval_ns as f64 * 1e-9)
}
