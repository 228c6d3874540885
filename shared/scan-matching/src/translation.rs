//! The shift between two scans whose angle is known, and the whole motion.

use nalgebra::{Matrix2, Matrix3, Rotation2, Vector2};
use serde::{Deserialize, Serialize};

use crate::config::{ConfigError, Overlap, Peak, TranslationConfig, accept};
use crate::fft::{PairSpectrum, fast_size};
use crate::overlap::OverlapEnergy;
use crate::peak::{PlanePeak, SUPPORT, plane_peak, soft_argmax};
use crate::rotation::RotationEstimate;
use crate::warp::Rotation;
use crate::{ShapeError, expect_shape, kernels, whiten};

/// Half width of the neighbourhood in which a second maximum is still the same peak, cells.
const SAME_PEAK_CELLS: isize = 3;

/// Another shift that matches nearly as well.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MotionRunnerUp {
    /// Forward, m, in the earlier scan's frame.
    pub x_m: f64,
    /// Left, m, in the earlier scan's frame.
    pub y_m: f64,
    /// Its correlation coefficient.
    pub score: f64,
}

/// Pose of the later scan's frame in the earlier scan's frame.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub struct MotionEstimate {
    /// Forward, m.
    pub x_m: f64,
    /// Left, m.
    pub y_m: f64,
    /// Counter-clockwise, radians.
    pub yaw_rad: f64,
    /// Covariance of (x, y, yaw) in m^2, m rad, rad^2: the peaks' shapes, and the angle's share of the shift.
    pub covariance: Matrix3<f64>,
    /// Correlation coefficient at the peak, at most 1; 0 where there is nothing to match.
    pub score: f64,
    /// The highest other local maximum within reach.
    pub runner_up: Option<MotionRunnerUp>,
    /// Whether the angle half a turn from the given one matched better.
    pub half_turn: bool,
}

/// Finds the shift between two scans of known angle (Weston et al., Algorithm 1, lines 16 to 21).
///
/// Planned once for rasters of n x n cells; nothing is allocated afterwards.
pub struct TranslationSearch {
    n: usize,
    cell_m: f64,
    config: TranslationConfig,
    transform: PairSpectrum,
    /// f with what is not finite set to zero, and g turned into f's direction.
    later: Vec<f32>,
    turned: Vec<f32>,
    later_energy: OverlapEnergy,
    turned_energy: OverlapEnergy,
    /// Largest shift searched, cells.
    reach: isize,
    /// Row of the transform for each shift in `scores`.
    rows: Vec<usize>,
    /// Correlation coefficients for shifts of up to `reach + SUPPORT` cells, row after row.
    scores: Vec<f32>,
}

impl TranslationSearch {
    /// Plans a search over rasters of `n` x `n` cells of `cell_m` metres.
    ///
    /// # Errors
    /// A configuration that no search can be built from: also a reach of more than half the raster.
    pub fn new(n: usize, cell_m: f64, config: &TranslationConfig) -> Result<Self, ConfigError> {
        config.validate()?;
        accept((16..=8192).contains(&n), "raster", "n", &n, "16 to 8192 cells a side")?;
        accept(cell_m.is_finite() && cell_m > 0.0, "raster", "cell_m", &cell_m, "metres, above 0")?;
        let reach = (config.reach_m / cell_m + 1e-9).floor();
        let fits = reach >= 1.0 && reach <= (n / 2 - SUPPORT) as f64;
        accept(fits, "translation", "reach_m", &config.reach_m, "at least one cell, less than half the raster")?;
        let reach = reach as usize;
        let around = reach + SUPPORT;
        // Shifts of up to `around` cells must not meet their own wrapped end: n + around, not 2 n - 1.
        let size = fast_size(n + around);
        let shifts = -(around as isize)..=around as isize;
        Ok(Self {
            n,
            cell_m,
            config: config.clone(),
            transform: PairSpectrum::new(size),
            later: vec![0.0; n * n],
            turned: vec![0.0; n * n],
            later_energy: OverlapEnergy::new(n, around),
            turned_energy: OverlapEnergy::new(n, around),
            reach: reach as isize,
            rows: shifts.map(|s| s.rem_euclid(size as isize) as usize).collect(),
            scores: vec![0.0; (2 * around + 1).pow(2)],
        })
    }

    /// The motion between two rasters, given the angle between them.
    ///
    /// Rasters are n x n, row 0 far ahead, column 0 far left. Values that are not finite count as zero.
    ///
    /// # Errors
    /// Where a raster is not of this search's shape.
    pub fn search(
        &mut self,
        later: &[f32],
        earlier: &[f32],
        rotation: &RotationEstimate,
    ) -> Result<MotionEstimate, ShapeError> {
        expect_shape("later raster", later.len(), self.n * self.n)?;
        expect_shape("earlier raster", earlier.len(), self.n * self.n)?;
        kernels::finite_copy(later, &mut self.later);
        self.later_energy.measure(&self.later);
        let straight = self.at_angle(earlier, rotation.angle_rad, rotation.variance_rad2);
        if !self.config.half_turn {
            return Ok(straight);
        }
        let other = opposite(rotation.angle_rad);
        let reversed = self.at_angle(earlier, other, rotation.variance_rad2);
        Ok(if reversed.score > straight.score { MotionEstimate { half_turn: true, ..reversed } } else { straight })
    }

    /// The motion if the angle is `angle_rad`.
    fn at_angle(&mut self, earlier: &[f32], angle_rad: f64, variance_rad2: f64) -> MotionEstimate {
        self.turn(earlier, angle_rad); // line 16
        self.turned_energy.measure(&self.turned);
        let energy = (self.later_energy.total() * self.turned_energy.total()).sqrt();
        if !(energy.is_finite() && energy > 0.0) {
            return self.no_match(angle_rad, variance_rad2);
        }
        self.correlate(energy); // lines 17 and 18
        let Some(best) = self.highest() else { return self.no_match(angle_rad, variance_rad2) };
        let peak = plane_peak(self.config.peak, |i, j| self.at(best.0 + i, best.1 + j));
        let shift = self.place(best, &peak); // line 19
        self.motion(shift, &peak, self.runner_up(best), angle_rad, variance_rad2) // lines 20 and 21
    }

    /// g'(x) = g(R x), so that f(x) ~ g'(x + R^T t).
    fn turn(&mut self, earlier: &[f32], angle_rad: f64) {
        let rotation = Rotation::new(self.n, angle_rad);
        for (r, row) in self.turned.chunks_exact_mut(self.n).enumerate() {
            rotation.row(earlier, r, row);
            row.iter_mut().for_each(|v| *v = if v.is_finite() { *v } else { 0.0 });
        }
    }

    /// C(s) = sum of f(x) g'(x + s) over the zero-padded rasters, as correlation coefficients.
    fn correlate(&mut self, energy: f64) {
        let (n, later, turned) = (self.n, &self.later, &self.turned);
        self.transform.forward(n, |r, out| {
            let row = r * n..(r + 1) * n;
            for ((z, &f), &g) in out.iter_mut().zip(&later[row.clone()]).zip(&turned[row]) {
                z.re = f;
                z.im = g;
            }
        });
        self.transform.cross();
        if self.config.phase_only {
            self.transform.cross_spectrum_mut().iter_mut().for_each(whiten::to_unit); // Checchin et al., Eq. 6
        }
        self.read_scores(energy);
    }

    fn read_scores(&mut self, energy: f64) {
        let side = self.rows.len();
        let around = (side / 2) as isize;
        let size = self.transform.size();
        let cells = (size * size) as f64;
        let scale = if self.config.phase_only { 1.0 / cells } else { 1.0 / (cells * energy) };
        let (rows, scores) = (&self.rows, &mut self.scores);
        self.transform.inverse(rows, |r, row| {
            for (score, &column) in scores[r * side..][..side].iter_mut().zip(rows) {
                *score = row[column] * scale as f32;
            }
        });
        if self.config.phase_only || self.config.overlap == Overlap::None {
            return;
        }
        for (k, score) in self.scores.iter_mut().enumerate() {
            let (down, right) = ((k / side) as isize - around, (k % side) as isize - around);
            let share = match self.config.overlap {
                Overlap::Area => area_share(self.n, down, right),
                _ => {
                    // A shift of g' by s meets f without its last s rows, and loses its own first s rows.
                    let f = self.later_energy.left_after(-down, -right);
                    let g = self.turned_energy.left_after(down, right);
                    (f * g).sqrt() / energy
                }
            };
            *score = if share > 1e-3 { (f64::from(*score) / share) as f32 } else { 0.0 };
        }
    }

    /// The score at a shift of (down, right) cells, within `reach + SUPPORT`.
    fn at(&self, down: isize, right: isize) -> f64 {
        let side = self.rows.len() as isize;
        let around = side / 2;
        f64::from(self.scores[((down + around) * side + right + around) as usize])
    }

    /// Every shift within reach with its score.
    fn scored(&self) -> impl Iterator<Item = ((isize, isize), f64)> + Clone {
        let reach = self.reach;
        (-reach..=reach).flat_map(move |i| (-reach..=reach).map(move |j| ((i, j), self.at(i, j))))
    }

    fn highest(&self) -> Option<(isize, isize)> {
        let finite = self.scored().filter(|(_, score)| score.is_finite());
        let best = finite.fold(None, |best: Option<((isize, isize), f64)>, new| match best {
            Some(old) if old.1 >= new.1 => Some(old),
            _ => Some(new),
        })?;
        (best.1 > 0.0).then_some(best.0)
    }

    /// The peak's place in cells (down, right).
    fn place(&self, best: (isize, isize), peak: &PlanePeak) -> Vector2<f64> {
        match self.config.peak {
            Peak::SoftArgmax { temperature } => {
                let scored = self.scored().map(|((i, j), score)| ([i as f64, j as f64], score));
                Vector2::from(soft_argmax(temperature, self.at(best.0, best.1), scored))
            }
            _ => Vector2::new(best.0 as f64, best.1 as f64) + peak.offset,
        }
    }

    fn runner_up(&self, best: (isize, isize)) -> Option<((isize, isize), f64)> {
        let apart = |(i, j): (isize, isize)| (i - best.0).abs().max((j - best.1).abs()) > SAME_PEAK_CELLS;
        let summit =
            |(i, j): (isize, isize), score: f64| (-1..=1).all(|a| (-1..=1).all(|b| self.at(i + a, j + b) <= score));
        let mut second: Option<((isize, isize), f64)> = None;
        for (shift, score) in self.scored() {
            if second.is_none_or(|(_, s)| score > s) && apart(shift) && summit(shift, score) {
                second = Some((shift, score));
            }
        }
        second
    }

    /// t = R t' with t' the shift along the raster's axes: rows run backward, columns to the right.
    fn motion(
        &self,
        shift: Vector2<f64>,
        peak: &PlanePeak,
        runner_up: Option<((isize, isize), f64)>,
        angle_rad: f64,
        variance_rad2: f64,
    ) -> MotionEstimate {
        let turn = Rotation2::new(angle_rad);
        let translation = turn * shift * -self.cell_m;
        let score = peak.value.min(1.0);
        MotionEstimate {
            x_m: translation.x,
            y_m: translation.y,
            yaw_rad: angle_rad,
            covariance: self.covariance(&turn, self.shift_covariance(score, &peak.hessian), variance_rad2),
            score,
            runner_up: runner_up.map(|((i, j), score)| {
                let other = turn * Vector2::new(i as f64, j as f64) * -self.cell_m;
                MotionRunnerUp { x_m: other.x, y_m: other.y, score }
            }),
            half_turn: false,
        }
    }

    /// (1 - score) over the peak's curvature, scaled, m^2; never more than a uniform guess within reach.
    fn shift_covariance(&self, score: f64, hessian: &Matrix2<f64>) -> Matrix2<f64> {
        let scale = self.config.variance_scale * (1.0 - score).max(1e-6) * self.cell_m.powi(2);
        let guess = self.config.reach_m.powi(2) / 3.0;
        match (-hessian).try_inverse() {
            Some(shape) if shape.trace() > 0.0 && shape.determinant() > 0.0 && shape.trace() * scale < guess => {
                shape * scale
            }
            _ => Matrix2::identity() * guess,
        }
    }

    /// Covariance of (x, y, yaw). An error e of the angle turns g' about the sensor, and the scene seen at `centre`
    /// of f moves by R J centre e: that is what the shift makes up for, so x and y follow the angle by -R J centre.
    fn covariance(&self, turn: &Rotation2<f64>, shift: Matrix2<f64>, variance_rad2: f64) -> Matrix3<f64> {
        let placed = turn.matrix() * shift * turn.matrix().transpose();
        let centre = self.centre_m();
        let lever = turn * Vector2::new(centre.y, -centre.x);
        let mut covariance = Matrix3::zeros();
        covariance.fixed_view_mut::<2, 2>(0, 0).copy_from(&(placed + lever * lever.transpose() * variance_rad2));
        covariance.fixed_view_mut::<2, 1>(0, 2).copy_from(&(lever * variance_rad2));
        covariance.fixed_view_mut::<1, 2>(2, 0).copy_from(&(lever.transpose() * variance_rad2));
        covariance[(2, 2)] = variance_rad2;
        covariance
    }

    /// Centre of the later scan's energy, m, in its own frame.
    fn centre_m(&self) -> Vector2<f64> {
        self.later_energy.centre() * -self.cell_m
    }

    fn no_match(&self, angle_rad: f64, variance_rad2: f64) -> MotionEstimate {
        let guess = self.config.reach_m.powi(2) / 3.0;
        MotionEstimate {
            x_m: 0.0,
            y_m: 0.0,
            yaw_rad: angle_rad,
            covariance: Matrix3::from_diagonal(&[guess, guess, variance_rad2].into()),
            score: 0.0,
            runner_up: None,
            half_turn: false,
        }
    }
}

/// The angle half a turn away, within (-pi, pi].
fn opposite(angle_rad: f64) -> f64 {
    use std::f64::consts::PI;
    if angle_rad > 0.0 { angle_rad - PI } else { angle_rad + PI }
}

/// Share of the cells that overlap at a shift.
fn area_share(n: usize, down: isize, right: isize) -> f64 {
    let along = |s: isize| 1.0 - s.unsigned_abs() as f64 / n as f64;
    along(down) * along(right)
}
