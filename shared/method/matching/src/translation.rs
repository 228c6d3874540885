use gyre_geometry::{Pose, pose};
use nalgebra::{Matrix3, Rotation2, Vector2};
use ndarray::ArrayView2;
use serde::{Deserialize, Serialize};

use crate::{
    SettingError, ShapeError, cells,
    config::TranslationConfig,
    covariance::{guess, motion_covariance, shift_covariance},
    fft::{PairSpectrum, fast_size},
    kernels,
    masked_correlation::keep_seen,
    overlap::OverlapEnergy,
    peak::PlanePeak,
    rotation::RotationMatch,
    scores::{Scores, Shift, reach_cells},
    warp::Rotation,
    whiten,
};

#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MotionRunnerUp {
    /// Forward, m, in the earlier scan's frame.
    pub x_m: f64,
    /// Left, m, in the earlier scan's frame.
    pub y_m: f64,
    pub score: f64,
}

/// The motion between two scans: the pose of the later scan's frame in the earlier scan's frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MotionMatch {
    pub x_m: f64,
    pub y_m: f64,
    pub yaw_rad: f64,
    /// Covariance of (x, y, yaw), m^2, m rad and rad^2: from the shapes of the peaks, and the
    /// shift's dependence on the angle.
    pub covariance: Matrix3<f64>,
    /// Correlation coefficient at the peak, at most 1; 0 if there is no match.
    pub score: f64,
    pub runner_up: Option<MotionRunnerUp>,
}

impl MotionMatch {
    pub fn pose(&self) -> Pose {
        pose(self.x_m, self.y_m, self.yaw_rad)
    }

    /// No match: the shift may be anywhere within reach.
    pub(crate) fn none(reach_m: f64, yaw_rad: f64, variance_rad2: f64) -> Self {
        let guess = guess(reach_m);
        Self {
            x_m: 0.0,
            y_m: 0.0,
            yaw_rad,
            covariance: Matrix3::from_diagonal(&[guess, guess, variance_rad2].into()),
            score: 0.0,
            runner_up: None,
        }
    }
}

/// Factor of the covariance: factor x (1 - score) x inverse curvature of the peak, calibrated like
/// the factor of the angle.
const VARIANCE_SCALE: f64 = 0.015;

/// Finds the shift between two scans whose angle is known (Weston et al., Algorithm 1, lines 16 to
/// 21).
pub struct TranslationSearch {
    n: usize,
    cell_m: f64,
    config: TranslationConfig,
    transform: PairSpectrum,
    /// f, with values that are not finite set to zero, and g turned into f's direction.
    later: Vec<f32>,
    turned: Vec<f32>,
    later_energy: OverlapEnergy,
    turned_energy: OverlapEnergy,
    scores: Scores,
}

impl TranslationSearch {
    /// Plans a search over rasters of `n` x `n` cells of `cell_m` metres.
    pub fn new(n: usize, cell_m: f64, config: &TranslationConfig) -> Result<Self, SettingError> {
        config.validate()?;
        let reach = reach_cells(n, cell_m, "translation", config.reach_m)?;
        let size = fast_size(Scores::min_size(n, reach));
        let around = Scores::around(reach);
        Ok(Self {
            n,
            cell_m,
            config: config.clone(),
            transform: PairSpectrum::new(size),
            later: vec![0.0; n * n],
            turned: vec![0.0; n * n],
            later_energy: OverlapEnergy::new(n, around),
            turned_energy: OverlapEnergy::new(n, around),
            scores: Scores::new(reach, size),
        })
    }

    /// Rasters are n x n, row 0 far ahead, column 0 far left. Values that are not finite count as
    /// zero.
    pub fn search(
        &mut self,
        later: ArrayView2<'_, f32>,
        earlier: ArrayView2<'_, f32>,
        rotation: &RotationMatch,
    ) -> Result<MotionMatch, ShapeError> {
        self.search_seen(later, earlier, None, rotation)
    }

    /// As [`search`](Self::search), where the later scan's sensor could not see everything: `seen`,
    /// in the directions of the later raster, is 1 where it could, and 0 elsewhere. The earlier
    /// raster counts only there, as seen from its own sensor.
    pub fn search_seen(
        &mut self,
        later: ArrayView2<'_, f32>,
        earlier: ArrayView2<'_, f32>,
        seen: Option<ArrayView2<'_, f32>>,
        rotation: &RotationMatch,
    ) -> Result<MotionMatch, ShapeError> {
        let later = cells("later raster", &later, self.n)?;
        let earlier = cells("earlier raster", &earlier, self.n)?;
        let seen = seen.as_ref().map(|seen| cells("seen cells", seen, self.n));
        let seen = seen.transpose()?;
        kernels::finite_copy(later, &mut self.later);
        self.later_energy.measure(&self.later);
        let (angle_rad, variance_rad2) = (rotation.angle_rad, rotation.variance_rad2);
        Ok(self.at_angle(earlier, seen, angle_rad, variance_rad2))
    }

    fn at_angle(
        &mut self,
        earlier: &[f32],
        seen: Option<&[f32]>,
        angle_rad: f64,
        variance_rad2: f64,
    ) -> MotionMatch {
        self.turn(earlier, angle_rad); // line 16
        if let Some(seen) = seen {
            keep_seen(&mut self.turned, seen);
        }
        self.turned_energy.measure(&self.turned);
        let energy = (self.later_energy.total * self.turned_energy.total).sqrt();
        if !(energy.is_finite() && energy > 0.0) {
            return MotionMatch::none(self.config.reach_m, angle_rad, variance_rad2);
        }
        self.correlate(energy); // lines 17 and 18
        let Some(best) = self.scores.highest() else {
            return MotionMatch::none(self.config.reach_m, angle_rad, variance_rad2);
        };
        let peak = self.scores.peak(self.config.peak, best); // line 19
        let runner_up = self.scores.runner_up(best);
        self.motion(&peak, runner_up, angle_rad, variance_rad2) // lines 20 and 21
    }

    /// g'(x) = g(R x), so that f(x) ~ g'(x + R^T t).
    fn turn(&mut self, earlier: &[f32], angle_rad: f64) {
        let rotation = Rotation::new(self.n, angle_rad);
        for (r, row) in self.turned.chunks_exact_mut(self.n).enumerate() {
            rotation.row(earlier, r, row);
            row.iter_mut()
                .for_each(|v| *v = if v.is_finite() { *v } else { 0.0 });
        }
    }

    /// C(s) = sum of f(x) g'(x + s) over the zero-padded rasters, as correlation coefficients.
    fn correlate(&mut self, energy: f64) {
        let (n, later, turned) = (self.n, &self.later, &self.turned);
        self.transform.forward(n, |r, out| {
            kernels::interleave(&later[r * n..][..n], &turned[r * n..][..n], out);
        });
        self.transform.cross();
        if self.config.phase_only {
            self.transform
                .cross_spectrum_mut()
                .iter_mut()
                .for_each(whiten::to_unit); // Checchin et al., Eq. 6
        }
        self.read_scores(energy);
    }

    fn read_scores(&mut self, energy: f64) {
        let size = self.transform.size;
        let cells = (size * size) as f64;
        let scale = if self.config.phase_only {
            1.0 / cells
        } else {
            1.0 / (cells * energy)
        };
        let rows = self.scores.wrapped.clone();
        self.transform.inverse(&rows, |r, row| {
            self.scores.fill(r, row, |value: f32| value * scale as f32)
        });
        if !self.config.phase_only {
            self.scores.normalise(
                self.config.overlap,
                &self.later_energy,
                &self.turned_energy,
                energy,
            );
        }
    }

    /// t = R t' with t' the shift along the raster's axes: rows run backward, columns to the right.
    fn motion(
        &self,
        peak: &PlanePeak,
        runner_up: Option<(Shift, f64)>,
        angle_rad: f64,
        variance_rad2: f64,
    ) -> MotionMatch {
        let turn = Rotation2::new(angle_rad);
        let translation = turn * peak.offset * -self.cell_m;
        let score = peak.value.min(1.0);
        let guess = guess(self.config.reach_m);
        let spread = shift_covariance(VARIANCE_SCALE, score, &peak.hessian, self.cell_m, guess);
        MotionMatch {
            x_m: translation.x,
            y_m: translation.y,
            yaw_rad: angle_rad,
            covariance: motion_covariance(&turn, spread, self.lever(&turn), variance_rad2),
            score,
            runner_up: runner_up.map(|((i, j), score)| {
                let other = turn * Vector2::new(i as f64, j as f64) * -self.cell_m;
                MotionRunnerUp {
                    x_m: other.x,
                    y_m: other.y,
                    score,
                }
            }),
        }
    }

    /// The derivative of (x, y) by the angle, m/rad: an error e turns g' about the sensor, and the
    /// scene at `centre` of f moves by R J centre e. The shift compensates, so the derivative is -R
    /// J centre.
    fn lever(&self, turn: &Rotation2<f64>) -> Vector2<f64> {
        let centre = self.later_energy.centre() * -self.cell_m;
        turn * Vector2::new(centre.y, -centre.x)
    }
}
