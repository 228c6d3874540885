//! What the pipeline makes of a chain of scans, with the true motions in place of those it would find: raster by raster as
//! `masking` publishes it, and the motion that the decoupled search finds between two of them.

use std::collections::VecDeque;

use gyre_masking::{MaskError, MaskKind, Masker, MaskerError, Sweep};
use gyre_messages::SearchedMotion;
use gyre_radar::PolarScan;
use gyre_scan_matching::{
    ConfigError, PolarSpectrum, RotationSearch, ShapeError, TranslationSearch, square,
};
use half::{f16, slice::HalfFloatSliceExt};
use nalgebra::Isometry2;
use thiserror::Error;

use super::record::Record;
use gyre::configuration::Configuration;

/// Settings that nothing can be prepared with.
#[derive(Debug, Error)]
pub enum SettingError {
    /// A network is to mask what networks are to be trained on.
    #[error(
        "masking.kind is `learned`, but masks are learnt from what no network has masked: set it to `threshold` or `none`"
    )]
    Learned,
    /// Masking's.
    #[error(transparent)]
    Masker(#[from] MaskerError),
    /// The search's.
    #[error(transparent)]
    Search(#[from] ConfigError),
}

/// Why a scan cannot be prepared.
#[derive(Debug, Error)]
pub enum PreparationError {
    /// It makes no raster.
    #[error(transparent)]
    Mask(#[from] MaskError),
    /// Its raster cannot be searched.
    #[error(transparent)]
    Shape(#[from] ShapeError),
}

/// See the module. Nothing is allocated once it is planned.
pub struct Preparation {
    n: usize,
    masker: Masker,
    rotation: RotationSearch,
    translation: TranslationSearch,
    /// Which motion a sweep is compensated with; 0: with none.
    lag: usize,
    rounded: Vec<f16>,
    later: View,
    earlier: View,
    /// The last `lag + 1` scans of the chain.
    chain: VecDeque<Place>,
}

/// A raster as it is read back from a file, and its spectrum.
struct View {
    cells: Vec<f32>,
    spectrum: PolarSpectrum,
}

/// When a scan was where.
#[derive(Clone, Copy)]
struct Place {
    stamp_ns: i64,
    pose: Isometry2<f64>,
}

impl Preparation {
    /// Plans rasters and searches.
    ///
    /// # Errors
    /// The first setting that is out of its bounds.
    pub fn new(configuration: &Configuration) -> Result<Self, SettingError> {
        let (raster, masking) = (&configuration.raster, &configuration.masking);
        if masking.kind == MaskKind::Learned {
            return Err(SettingError::Learned);
        }
        let rotation = RotationSearch::new(raster.n, &configuration.rotation)?;
        let cells = raster.n * raster.n;
        let view = || View {
            cells: vec![0.0; cells],
            spectrum: rotation.new_spectrum(),
        };
        let (later, earlier) = (view(), view());
        Ok(Self {
            n: raster.n,
            masker: Masker::new(raster, &configuration.points, masking)?,
            rotation,
            translation: TranslationSearch::new(
                raster.n,
                raster.cell_m.into(),
                &configuration.translation,
            )?,
            lag: masking.feedback_lag(),
            rounded: vec![f16::ZERO; cells],
            later,
            earlier,
            chain: VecDeque::with_capacity(masking.feedback_lag() + 2),
        })
    }

    /// Whether the next scan begins a chain.
    pub fn begins(&self) -> bool {
        self.chain.is_empty()
    }

    /// Has the next scan begin a chain.
    pub fn begin(&mut self) {
        self.chain.clear();
    }

    /// The next scan's record. `pose` is the truth at the scan's time. After an error the chain is as it was.
    ///
    /// # Errors
    /// A scan that contradicts itself.
    pub fn next(
        &mut self,
        scan: &PolarScan<'_>,
        pose: Isometry2<f64>,
        sequence: u32,
    ) -> Result<Record<'_>, PreparationError> {
        let sweep = Sweep {
            number: 0,
            scan: *scan,
            motion: self.known_motion(),
        };
        let twist = self.masker.mask(&sweep, None, &mut self.later.cells)?;
        // What is learnt from is the file, so what is searched is what the file says.
        self.rounded.convert_from_f32_slice(&self.later.cells);
        self.rounded.convert_to_f32_slice(&mut self.later.cells);
        let searched = self.search()?;
        let stamp_ns = scan.geometry.stamp_ns;
        self.remember(Place { stamp_ns, pose });
        Ok(Record {
            raster: &self.rounded,
            searched: searched.unwrap_or([f64::NAN; 3]),
            pose: [
                pose.translation.x,
                pose.translation.y,
                pose.rotation.angle(),
            ],
            time_s: stamp_ns as f64 * 1e-9,
            twist: twist.map_or([0.0; 3], |t| {
                [t.vx_mps as f32, t.vy_mps as f32, t.yaw_rate_radps as f32]
            }),
            sequence,
        })
    }

    /// The true motion of the scan `lag` before the next one, as masking would hear it from the search.
    fn known_motion(&self) -> Option<SearchedMotion> {
        let (from, to) = (self.chain.front()?, self.chain.get(1)?);
        let motion = from.pose.inverse() * to.pose;
        (self.chain.len() > self.lag).then(|| SearchedMotion {
            x_m: motion.translation.x,
            y_m: motion.translation.y,
            yaw_rad: motion.rotation.angle(),
            interval_ns: to.stamp_ns.saturating_sub(from.stamp_ns),
        })
    }

    /// The motion from the raster before to this one; `None` where the chain begins.
    fn search(&mut self) -> Result<Option<[f64; 3]>, ShapeError> {
        let (later, earlier) = (&mut self.later, &self.earlier);
        let raster = square("raster", &later.cells, self.n)?;
        self.rotation.spectrum(raster, &mut later.spectrum)?;
        if self.chain.is_empty() {
            return Ok(None);
        }
        let rotation = self.rotation.search(&later.spectrum, &earlier.spectrum)?;
        let motion = self.translation.search(
            raster,
            square("raster", &earlier.cells, self.n)?,
            &rotation,
        )?;
        Ok(Some([motion.x_m, motion.y_m, motion.yaw_rad]))
    }

    /// Makes this scan the one before.
    fn remember(&mut self, place: Place) {
        std::mem::swap(&mut self.later, &mut self.earlier);
        self.chain.push_back(place);
        if self.chain.len() > self.lag + 1 {
            self.chain.pop_front();
        }
    }
}
