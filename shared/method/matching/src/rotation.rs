use std::{f64::consts::PI, ops::RangeInclusive, sync::Arc};

use gyre_radar::fourier::{Complex32, ComplexToReal, RealToComplex};
use ndarray::ArrayView2;
use serde::{Deserialize, Serialize};

use crate::{
    SettingError, ShapeError, cells,
    config::{RotationConfig, RotationForm},
    covariance::guess,
    fft::{RealLines, RealSpectrum, fast_size},
    kernels,
    peak::line_peak,
    polar::PolarGrid,
    scores::check_side,
    spectrum::PolarSpectrum,
    taper,
    whiten::Whitening,
};

/// Distance from the turn of a gyro beyond which a maximum counts as spurious, rad.
const NEAR_GYRO_RAD: f64 = 4.0 * PI / 180.0;
/// Half width of the neighbourhood where a second maximum counts as the same peak, rad.
const SAME_PEAK_RAD: f64 = 2.0 * PI / 180.0;

/// Factor of the variance: factor x (1 - score) / curvature of the peak. The curvature gives the
/// shape alone; the factor, about the inverse of the number of independent samples, is calibrated
/// on real scans with known motions.
const VARIANCE_SCALE: f64 = 0.12;

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RotationRunnerUp {
    pub angle_rad: f64,
    pub score: f64,
}

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct RotationMatch {
    /// Yaw of the later scan's frame in the earlier one's, radians, counter-clockwise, within the
    /// reach.
    pub angle_rad: f64,
    /// Variance, from the shape of the peak; without a peak, the variance of a uniform distribution
    /// over the reach.
    pub variance_rad2: f64,
    /// Correlation coefficient of the two polar spectra at the peak, at most 1; 0 if there is no
    /// match.
    pub score: f64,
    pub runner_up: Option<RotationRunnerUp>,
}

impl RotationMatch {
    /// No match: the angle may be anywhere about this one.
    pub(crate) fn none(angle_rad: f64, variance_rad2: f64) -> Self {
        Self {
            angle_rad,
            variance_rad2,
            score: 0.0,
            runner_up: None,
        }
    }
}

/// Finds the angle between two scans (Weston et al., Algorithm 1, lines 5 to 15).
pub struct RotationSearch {
    n: usize,
    config: RotationConfig,
    taper: Vec<f32>,
    transform: RealSpectrum,
    rings: RealLines,
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
    pub fn new(n: usize, config: &RotationConfig) -> Result<Self, SettingError> {
        config.validate()?;
        check_side(n)?;
        let size = fast_size(n);
        let (angles, harmonics) = (config.angles, config.angles / 2 + 1);
        let grid = PolarGrid::new(n, size, config);
        let (forward, inverse) = (
            gyre_radar::fourier::real(angles),
            gyre_radar::fourier::real_inverse(angles),
        );
        let scratch = forward.get_scratch_len().max(inverse.get_scratch_len());
        let step = PI / angles as f64;
        Ok(Self {
            n,
            taper: taper::weights(config.window, n),
            transform: RealSpectrum::new(size, PolarGrid::columns(config.band_high, size)),
            whitening: (config.phase_only && config.form == RotationForm::Eq7)
                .then(|| Whitening::new(grid.radii, harmonics)),
            rings: RealLines::new(angles),
            grid,
            forward,
            inverse,
            scratch: vec![Complex32::default(); scratch],
            ring: vec![0.0; angles],
            profile: vec![0.0; angles],
            cross: vec![Complex32::default(); harmonics],
            correlation: vec![0.0; angles],
            reach: ((config.reach_deg.to_radians() / step).floor() as isize)
                .clamp(1, angles as isize / 2),
            config: config.clone(),
        })
    }

    pub fn new_spectrum(&self) -> PolarSpectrum {
        PolarSpectrum::new(self.grid.angles, self.profiles())
    }

    /// Computes the polar magnitude spectrum of one scan. Keep it: the next pair needs it again.
    ///
    /// `raster` is n x n, row 0 far ahead, column 0 far left. Values that are not finite count as
    /// zero.
    pub fn spectrum(
        &mut self,
        raster: ArrayView2<'_, f32>,
        out: &mut PolarSpectrum,
    ) -> Result<(), ShapeError> {
        let raster = cells("raster", &raster, self.n)?;
        out.expect(self.profiles(), self.grid.angles)?;
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

    /// Finds the angle between two scans from their spectra; near the turn that a gyro has
    /// measured, rad, if it is given.
    pub fn search(
        &mut self,
        later: &PolarSpectrum,
        earlier: &PolarSpectrum,
        turn_rad: Option<f64>,
    ) -> Result<RotationMatch, ShapeError> {
        later.expect(self.profiles(), self.grid.angles)?;
        earlier.expect(self.profiles(), self.grid.angles)?;
        let energy = (later.energy * earlier.energy).sqrt();
        if !(energy.is_finite() && energy > 0.0) {
            return Ok(self.no_match());
        }
        self.correlate(later, earlier, energy);
        Ok(self.best_match(self.shifts_near(turn_rad)))
    }

    fn profiles(&self) -> usize {
        if self.config.form == RotationForm::Eq7 {
            self.grid.radii
        } else {
            1
        }
    }

    /// Taper, transform, modulus, band (Weston et al., Algorithm 1, lines 5 to 10).
    fn magnitudes(&mut self, raster: &[f32]) {
        let (n, taper) = (self.n, &self.taper);
        self.transform.forward(n, |r, out| {
            let row = r * n..(r + 1) * n;
            kernels::weigh(&raster[row.clone()], &taper[row], out);
        });
        self.grid.load(&self.transform.plane);
    }

    /// One transform along the angle for each radius (Weston et al., Eq. 7).
    fn transform_rings(&mut self, out: &mut PolarSpectrum) {
        let harmonics = out.harmonics();
        for (k, pair) in out.data.chunks_mut(2 * harmonics).enumerate() {
            let (first, second) = pair.split_at_mut(harmonics);
            let ring = |r, ring: &mut [f32]| self.grid.ring(2 * k + r, ring);
            self.rings.forward(ring, [first, second]);
        }
        out.data
            .iter_mut()
            .step_by(harmonics)
            .for_each(|mean| *mean = Complex32::default());
    }

    /// One transform of the sum over radii (Weston et al., Algorithm 1, line 14).
    fn transform_profile(&mut self, out: &mut PolarSpectrum) {
        self.profile.fill(0.0);
        for r in 0..self.grid.radii {
            self.grid.ring(r, &mut self.ring);
            self.profile
                .iter_mut()
                .zip(&self.ring)
                .for_each(|(sum, v)| *sum += v);
        }
        let done =
            self.forward
                .process_with_scratch(&mut self.profile, &mut out.data, &mut self.scratch);
        debug_assert!(done.is_ok(), "lengths are those of the plan");
        out.data[0] = Complex32::default();
    }

    /// C[m] = sum over r of G[m, r] conj(F[m, r]), transformed back to angles, as correlation
    /// coefficients (Weston et al., Eq. 7; line 14 with a single profile).
    fn correlate(&mut self, later: &PolarSpectrum, earlier: &PolarSpectrum, energy: f64) {
        self.cross.fill(Complex32::default());
        let rows = later
            .data
            .chunks_exact(self.cross.len())
            .zip(earlier.data.chunks_exact(self.cross.len()));
        for (f, g) in rows {
            kernels::add_cross(f, g, &mut self.cross);
        }
        // The highest harmonic of an even number of angles is real but for rounding, and the
        // inverse transform requires that it is.
        if let (true, Some(highest)) = (self.grid.angles.is_multiple_of(2), self.cross.last_mut()) {
            highest.im = 0.0;
        }
        let done = self.inverse.process_with_scratch(
            &mut self.cross,
            &mut self.correlation,
            &mut self.scratch,
        );
        debug_assert!(done.is_ok(), "lengths are those of the plan");
        let scale = energy.recip() as f32;
        self.correlation.iter_mut().for_each(|c| *c *= scale);
    }

    fn at(&self, k: isize) -> f64 {
        f64::from(self.correlation[k.rem_euclid(self.grid.angles as isize) as usize])
    }

    /// The shifts within reach, and near the turn of the gyro.
    fn shifts_near(&self, turn_rad: Option<f64>) -> RangeInclusive<isize> {
        let step = PI / self.grid.angles as f64;
        let within_reach = |shift: f64| (shift.round() as isize).clamp(-self.reach, self.reach);
        match turn_rad {
            None => -self.reach..=self.reach,
            Some(turn) => {
                within_reach((turn - NEAR_GYRO_RAD) / step)
                    ..=within_reach((turn + NEAR_GYRO_RAD) / step)
            }
        }
    }

    fn best_match(&self, within: RangeInclusive<isize>) -> RotationMatch {
        let step = PI / self.grid.angles as f64;
        let Some(best) = within.filter(|&k| self.at(k).is_finite()).max_by(|&a, &b| {
            self.at(a)
                .total_cmp(&self.at(b))
                .then(b.abs().cmp(&a.abs()))
        }) else {
            return self.no_match();
        };
        let peak = line_peak(self.config.peak, |j| self.at(best + j));
        let shift = best as f64 + peak.offset;
        let limit = self.config.reach_deg.to_radians();
        let score = peak.value.min(1.0);
        RotationMatch {
            angle_rad: (shift * step).clamp(-limit, limit),
            variance_rad2: self.variance(score, peak.curvature / (step * step)),
            score,
            runner_up: self.runner_up(best, step),
        }
    }

    /// (1 - score) over the peak's curvature, scaled; at most the variance of a uniform
    /// distribution over the reach.
    fn variance(&self, score: f64, curvature: f64) -> f64 {
        let variance = VARIANCE_SCALE * (1.0 - score).max(1e-6) / -curvature;
        let guess = guess(self.config.reach_deg.to_radians());
        if variance > 0.0 && variance < guess {
            variance
        } else {
            guess
        }
    }

    fn runner_up(&self, best: isize, step: f64) -> Option<RotationRunnerUp> {
        let apart = (SAME_PEAK_RAD / step).ceil() as isize;
        let k = (-self.reach..=self.reach)
            .filter(|k| (k - best).abs() > apart)
            .filter(|&k| self.at(k) > self.at(k - 1) && self.at(k) >= self.at(k + 1))
            .max_by(|&a, &b| self.at(a).total_cmp(&self.at(b)))?;
        Some(RotationRunnerUp {
            angle_rad: k as f64 * step,
            score: self.at(k),
        })
    }

    fn no_match(&self) -> RotationMatch {
        RotationMatch::none(0.0, guess(self.config.reach_deg.to_radians()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const N: usize = 24;

    #[test]
    fn a_higher_peak_far_from_the_turn_of_the_gyro_is_not_taken() {
        let config = RotationConfig {
            reach_deg: 30.0,
            ..RotationConfig::default()
        };
        let mut search = RotationSearch::new(N, &config).unwrap();
        let step = PI / search.grid.angles as f64;
        let [true_peak, false_peak] =
            [5.0, -20.0].map(|deg: f64| (deg.to_radians() / step) as isize);
        let angles = search.grid.angles as isize;
        for (peak, height) in [(true_peak, 0.5), (false_peak, 0.9)] {
            for j in -4..=4 {
                let place = (peak + j).rem_euclid(angles) as usize;
                search.correlation[place] = height - 0.01 * (j * j) as f32;
            }
        }
        let found = |turn: Option<f64>| {
            let turn = turn.map(f64::to_radians);
            search
                .best_match(search.shifts_near(turn))
                .angle_rad
                .to_degrees()
        };
        assert!((found(None) + 20.0).abs() < 0.5);
        assert!((found(Some(6.5)) - 5.0).abs() < 0.5);
        assert!((found(Some(-18.0)) + 20.0).abs() < 0.5);
        let beyond = found(Some(80.0));
        assert!((26.0..=30.0).contains(&beyond), "within reach: {beyond}");
    }
}
