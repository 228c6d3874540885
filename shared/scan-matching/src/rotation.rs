//! The angle between two scans, from their magnitude spectra alone.

use std::f64::consts::PI;
use std::sync::Arc;

use realfft::{ComplexToReal, RealFftPlanner, RealToComplex};
use rustfft::num_complex::Complex32;
use serde::{Deserialize, Serialize};

use crate::config::{ConfigError, Peak, RotationConfig, RotationForm, accept};
use crate::fft::{RealSpectrum, fast_size};
use crate::peak::{line_peak, soft_argmax};
use crate::polar::PolarGrid;
use crate::whiten::Whitening;
use crate::{ShapeError, expect_shape, window};

/// Half width of the neighbourhood in which a second maximum is still the same peak, radians.
const SAME_PEAK_RAD: f64 = 2.0 * PI / 180.0;

/// The polar magnitude spectrum of one scan, transformed along the angle: all that a rotation search needs of it.
///
/// Row after row of `harmonics()` values, one row a radius (a single one for `line14`). Harmonic 0, the mean over
/// the angle, is zero.
#[derive(Debug, Clone, PartialEq)]
pub struct PolarSpectrum {
    harmonics: usize,
    data: Vec<Complex32>,
    energy: f64,
}

impl PolarSpectrum {
    /// Number of harmonics a radius: `angles / 2 + 1`.
    pub fn harmonics(&self) -> usize {
        self.harmonics
    }

    /// Number of radii.
    pub fn radii(&self) -> usize {
        self.data.len() / self.harmonics
    }

    /// The spectrum, radius after radius.
    pub fn as_slice(&self) -> &[Complex32] {
        &self.data
    }

    /// Takes over a spectrum that [`as_slice`](Self::as_slice) gave elsewhere.
    ///
    /// # Errors
    /// Where the length differs.
    pub fn copy_from_slice(&mut self, data: &[Complex32]) -> Result<(), ShapeError> {
        expect_shape("polar spectrum", data.len(), self.data.len())?;
        self.data.copy_from_slice(data);
        self.measure();
        Ok(())
    }

    /// Energy over all angles and radii, each harmonic above 0 standing for its mirror image too.
    fn measure(&mut self) {
        let sum = |row: &[Complex32]| row.iter().map(|z| z.norm_sqr()).sum::<f32>();
        let energy: f64 = self.data.chunks_exact(self.harmonics).map(|row| f64::from(sum(row))).sum();
        self.energy = if energy.is_finite() { energy } else { 0.0 };
    }
}

/// Another angle that matches nearly as well.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RotationRunnerUp {
    /// Angle, radians.
    pub angle_rad: f64,
    /// Its correlation coefficient.
    pub score: f64,
}

/// The angle that takes the later scan's frame into the earlier one's.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RotationEstimate {
    /// Yaw of the later scan's frame in the earlier one's, radians, counter-clockwise, within the reach.
    pub angle_rad: f64,
    /// Its variance, from the shape of the peak; that of a uniform guess where there is no peak.
    pub variance_rad2: f64,
    /// Correlation coefficient of the two polar spectra at the peak, at most 1; 0 where there is nothing to match.
    pub score: f64,
    /// The highest other local maximum within reach.
    pub runner_up: Option<RotationRunnerUp>,
}

/// Finds the angle between two scans (Weston et al., Algorithm 1, lines 5 to 15).
///
/// Planned once for rasters of n x n cells; nothing is allocated afterwards.
pub struct RotationSearch {
    n: usize,
    config: RotationConfig,
    window: Vec<f32>,
    transform: RealSpectrum,
    grid: PolarGrid,
    forward: Arc<dyn RealToComplex<f32>>,
    inverse: Arc<dyn ComplexToReal<f32>>,
    scratch: Vec<Complex32>,
    ring: Vec<f32>,
    profile: Vec<f32>,
    whitening: Option<Whitening>,
    cross: Vec<Complex32>,
    correlation: Vec<f32>,
    /// Largest shift searched, in samples of the angle.
    reach: isize,
}

impl RotationSearch {
    /// Plans a search over rasters of `n` x `n` cells.
    ///
    /// # Errors
    /// A configuration that no search can be built from, or rasters below 16 cells a side.
    pub fn new(n: usize, config: &RotationConfig) -> Result<Self, ConfigError> {
        config.validate()?;
        accept((16..=8192).contains(&n), "raster", "n", &n, "16 to 8192 cells a side")?;
        let size = fast_size(n);
        let (angles, harmonics) = (config.angles, config.angles / 2 + 1);
        let grid = PolarGrid::new(n, size, config);
        let mut planner = RealFftPlanner::new();
        let (forward, inverse) = (planner.plan_fft_forward(angles), planner.plan_fft_inverse(angles));
        let scratch = forward.get_scratch_len().max(inverse.get_scratch_len());
        let step = PI / angles as f64;
        Ok(Self {
            n,
            window: window::weights(config.window, n),
            transform: RealSpectrum::new(size, PolarGrid::columns(config.band_high, size)),
            whitening: (config.phase_only && config.form == RotationForm::Eq7)
                .then(|| Whitening::new(grid.radii, harmonics)),
            grid,
            forward,
            inverse,
            scratch: vec![Complex32::default(); scratch],
            ring: vec![0.0; angles],
            profile: vec![0.0; angles],
            cross: vec![Complex32::default(); harmonics],
            correlation: vec![0.0; angles],
            reach: ((config.reach_deg.to_radians() / step).floor() as isize).clamp(1, angles as isize / 2),
            config: config.clone(),
        })
    }

    /// An empty spectrum of this search's shape, to be filled by [`spectrum`](Self::spectrum).
    pub fn new_spectrum(&self) -> PolarSpectrum {
        let harmonics = self.grid.angles / 2 + 1;
        let rows = if self.config.form == RotationForm::Eq7 { self.grid.radii } else { 1 };
        PolarSpectrum { harmonics, data: vec![Complex32::default(); rows * harmonics], energy: 0.0 }
    }

    /// One scan's polar magnitude spectrum; keep it, the next pair needs it again.
    ///
    /// `raster` is n x n, row 0 far ahead, column 0 far left. Values that are not finite count as zero.
    ///
    /// # Errors
    /// Where `raster` or `out` is not of this search's shape.
    pub fn spectrum(&mut self, raster: &[f32], out: &mut PolarSpectrum) -> Result<(), ShapeError> {
        expect_shape("raster", raster.len(), self.n * self.n)?;
        self.check(out)?;
        self.magnitudes(raster); // lines 5 to 10
        match self.config.form {
            RotationForm::Eq7 => self.transform_rings(out), // lines 11 and 13
            RotationForm::ProfileMean => self.transform_profile(out), // line 14
        }
        if let Some(whitening) = &mut self.whitening {
            whitening.apply(&mut out.data); // Checchin et al., Eq. 6
        } else if self.config.phase_only {
            out.data.iter_mut().for_each(crate::whiten::to_unit);
        }
        out.measure();
        Ok(())
    }

    /// The angle between two scans, from their spectra.
    ///
    /// # Errors
    /// Where a spectrum is not of this search's shape.
    pub fn search(
        &mut self,
        later: &PolarSpectrum,
        earlier: &PolarSpectrum,
    ) -> Result<RotationEstimate, ShapeError> {
        self.check(later)?;
        self.check(earlier)?;
        let energy = (later.energy * earlier.energy).sqrt();
        if !(energy.is_finite() && energy > 0.0) {
            return Ok(self.no_match());
        }
        self.correlate(later, earlier, energy);
        Ok(self.estimate())
    }

    fn check(&self, spectrum: &PolarSpectrum) -> Result<(), ShapeError> {
        let rows = if self.config.form == RotationForm::Eq7 { self.grid.radii } else { 1 };
        expect_shape("harmonics of a polar spectrum", spectrum.harmonics, self.grid.angles / 2 + 1)?;
        expect_shape("polar spectrum", spectrum.data.len(), rows * spectrum.harmonics)
    }

    /// Window, transform, modulus, band (Weston et al., Algorithm 1, lines 5 to 10).
    fn magnitudes(&mut self, raster: &[f32]) {
        let (n, window) = (self.n, &self.window);
        self.transform.forward(n, |r, out| {
            let row = r * n..(r + 1) * n;
            weigh(&raster[row.clone()], &window[row], out);
        });
        self.grid.load(&self.transform.plane);
    }

    /// One transform along the angle for each radius (Weston et al., Eq. 7).
    fn transform_rings(&mut self, out: &mut PolarSpectrum) {
        for (r, row) in out.data.chunks_exact_mut(out.harmonics).enumerate() {
            self.grid.ring(r, &mut self.ring);
            let done = self.forward.process_with_scratch(&mut self.ring, row, &mut self.scratch);
            debug_assert!(done.is_ok(), "lengths are those of the plan");
            row[0] = Complex32::default();
        }
    }

    /// One transform of the sum over radii (Weston et al., Algorithm 1, line 14).
    fn transform_profile(&mut self, out: &mut PolarSpectrum) {
        self.profile.fill(0.0);
        for r in 0..self.grid.radii {
            self.grid.ring(r, &mut self.ring);
            self.profile.iter_mut().zip(&self.ring).for_each(|(sum, v)| *sum += v);
        }
        let done = self.forward.process_with_scratch(&mut self.profile, &mut out.data, &mut self.scratch);
        debug_assert!(done.is_ok(), "lengths are those of the plan");
        out.data[0] = Complex32::default();
    }

    /// C[m] = sum over r of G[m, r] conj(F[m, r]), back to angles, as correlation coefficients.
    fn correlate(&mut self, later: &PolarSpectrum, earlier: &PolarSpectrum, energy: f64) {
        self.cross.fill(Complex32::default());
        let rows = later.data.chunks_exact(later.harmonics).zip(earlier.data.chunks_exact(later.harmonics));
        for (f, g) in rows {
            accumulate(f, g, &mut self.cross);
        }
        if self.grid.angles % 2 == 0 {
            if let Some(nyquist) = self.cross.last_mut() {
                nyquist.im = 0.0;
            }
        }
        let done = self.inverse.process_with_scratch(&mut self.cross, &mut self.correlation, &mut self.scratch);
        debug_assert!(done.is_ok(), "lengths are those of the plan");
        // Each harmonic but 0 counts twice in the inverse and once in the energy.
        let scale = (0.5 / energy) as f32;
        self.correlation.iter_mut().for_each(|c| *c *= scale);
    }

    /// The correlation at a shift of `k` samples, on the circle.
    fn at(&self, k: isize) -> f64 {
        f64::from(self.correlation[k.rem_euclid(self.grid.angles as isize) as usize])
    }

    fn estimate(&self) -> RotationEstimate {
        let step = PI / self.grid.angles as f64;
        let within = -self.reach..=self.reach;
        let Some(best) = within.clone().filter(|&k| self.at(k).is_finite()).max_by(|&a, &b| {
            self.at(a).total_cmp(&self.at(b)).then(b.abs().cmp(&a.abs()))
        }) else {
            return self.no_match();
        };
        let peak = line_peak(self.config.peak, |j| self.at(best + j));
        let shift = match self.config.peak {
            Peak::SoftArgmax { temperature } => {
                // Around the peak on the circle, or the two far ends average to nonsense.
                let scored = (-self.reach..=self.reach).map(|j| ([j as f64], self.at(best + j)));
                best as f64 + soft_argmax(temperature, self.at(best), scored)[0]
            }
            _ => best as f64 + peak.offset,
        };
        let limit = self.config.reach_deg.to_radians();
        let score = peak.value.min(1.0);
        RotationEstimate {
            angle_rad: (shift * step).clamp(-limit, limit),
            variance_rad2: self.variance(score, peak.curvature / (step * step)),
            score,
            runner_up: self.runner_up(best, step),
        }
    }

    /// (1 - score) over the peak's curvature, scaled; never more than a uniform guess within reach.
    fn variance(&self, score: f64, curvature: f64) -> f64 {
        let variance = self.config.variance_scale * (1.0 - score).max(1e-6) / -curvature;
        let guess = self.config.reach_deg.to_radians().powi(2) / 3.0;
        if variance > 0.0 && variance < guess { variance } else { guess }
    }

    fn runner_up(&self, best: isize, step: f64) -> Option<RotationRunnerUp> {
        let apart = (SAME_PEAK_RAD / step).ceil() as isize;
        let k = (-self.reach..=self.reach)
            .filter(|k| (k - best).abs() > apart)
            .filter(|&k| self.at(k) > self.at(k - 1) && self.at(k) >= self.at(k + 1))
            .max_by(|&a, &b| self.at(a).total_cmp(&self.at(b)))?;
        Some(RotationRunnerUp { angle_rad: k as f64 * step, score: self.at(k) })
    }

    fn no_match(&self) -> RotationEstimate {
        let variance_rad2 = self.config.reach_deg.to_radians().powi(2) / 3.0;
        RotationEstimate { angle_rad: 0.0, variance_rad2, score: 0.0, runner_up: None }
    }
}

/// Row times window; what is not finite counts as zero.
fn weigh(row: &[f32], window: &[f32], out: &mut [f32]) {
    for ((o, &v), &w) in out.iter_mut().zip(row).zip(window) {
        *o = if v.is_finite() { v * w } else { 0.0 };
    }
}

/// cross += g conj(f)
fn accumulate(f: &[Complex32], g: &[Complex32], cross: &mut [Complex32]) {
    for ((c, f), g) in cross.iter_mut().zip(f).zip(g) {
        *c += g * f.conj();
    }
}
