//! Rasterises each scan, undoes its sweep's distortion, and masks what would mislead the search.

mod config;

use std::time::Duration;

use gyre_messages::{Masked, SearchedMotion, mask_kind};
use gyre_radar::{
    PolarScan,
    raster::{RasterConfig, Rasteriser, Twist},
};
use gyre_stage::{
    Launch, Stage, StageError, Statistics,
    scans::{ScanView, Scans},
    stage,
    writer::Draft,
};
use nalgebra::{Isometry2, Vector2};

pub use config::{MaskKind, MaskingConfig};

/// The stage's name.
pub const NAME: &str = "masking";

/// Runs the stage until it is told to stop.
pub fn run(launch: &Launch) -> Result<Statistics, StageError> {
    let raster: RasterConfig = launch.section("raster")?;
    let masking: MaskingConfig = launch.section("masking")?;
    let mut masker = Masker::new(&raster, &masking).map_err(|error| StageError::Configuration(error.to_string()))?;
    stage::run(launch, &mut masker)
}

/// Makes masked rasters of scans.
pub struct Masker {
    raster: RasterConfig,
    config: MaskingConfig,
    rasteriser: Rasteriser,
}

impl Masker {
    /// Plans the rasters.
    pub fn new(raster: &RasterConfig, config: &MaskingConfig) -> Result<Self, gyre_radar::raster::RasterError> {
        Ok(Self { raster: raster.clone(), config: config.clone(), rasteriser: Rasteriser::new(raster)? })
    }

    /// Masks one scan into `cells`, row 0 far ahead. Returns the velocity that its sweep's distortion was undone with.
    pub fn mask(
        &mut self,
        scan: &PolarScan<'_>,
        motion: Option<&SearchedMotion>,
        cells: &mut [f32],
    ) -> Result<Option<Twist>, gyre_radar::raster::RasterError> {
        let floor = self.config.floor();
        if let Some(twist) = motion.filter(|_| self.config.compensate).map(twist_of) {
            match self.rasteriser.rasterise(scan, floor, Some(twist), cells) {
                Ok(()) => return Ok(Some(twist)),
                // A motion that no vehicle makes is a wrong match: better no compensation than that.
                Err(gyre_radar::raster::RasterError::Twist { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        self.rasteriser.rasterise(scan, floor, None, cells)?;
        Ok(None)
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
        let cells = &mut values[..self.raster.n * self.raster.n];
        let twist = self.mask(&scan, input.motion.as_ref(), cells).map_err(|e| input.scan.malformed(e.to_string()))?;
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
