//! The exhaustive search: the correlation over all shifts at every angle of a grid.

mod config;

use std::f64::consts::FRAC_1_SQRT_2;

use config::AngleGrid;
use gyre_geometry::wrap_angle;
use nalgebra::{Rotation2, Vector2};
use ndarray::ArrayView2;

use crate::{
    SettingError, ShapeError, cells,
    config::{Overlap, Peak},
    correlate::KeptCorrelation,
    covariance::{guess, motion_covariance, shift_covariance},
    fft::fast_size,
    kernels,
    overlap::OverlapEnergy,
    peak::{LinePeak, PlanePeak, line_peak},
    rotation::{RotationMatch, RotationRunnerUp},
    scores::{Scores, Shift, reach_cells},
    translation::{MotionMatch, MotionRunnerUp},
    warp::Rotation,
};
pub use config::ExhaustiveConfig;

/// Offset of the bilinear lookups from the cells' centres while angles are compared, cells down and
/// to the right.
///
/// Interpolation blurs: along each axis by 1 - 2 a (1 - a) (1 - cos w) in power, with a the
/// position between two cells. A rotation goes through all a evenly, so a (1 - a) is 1/6 on
/// average, but a rotation by zero would not blur at all and would score differently from its
/// neighbours, which pushes the peak off zero. With a = (3 - sqrt 3) / 6, a (1 - a) is 1/6 there
/// too. The delay of such a lookup is a for long waves only, so the final shift is found without
/// the offset.
const OFFSET: f64 = 0.211_324_865_405_187_1;
/// Factor of the covariance: factor x (1 - score) x inverse curvature of the peak in all three
/// unknowns.
const VARIANCE_SCALE: f64 = 0.015;

#[derive(Debug, Clone, Copy, PartialEq)]
pub struct JointMatch {
    /// The angle; its runner-up is the next highest local maximum over the angles.
    pub rotation: RotationMatch,
    /// The whole motion; its runner-up is another shift at the same angle or the best shift at
    /// another angle.
    pub motion: MotionMatch,
}

/// Finds angle and shift together by trying all angles of a grid (Masking by Moving; `raw` in
/// Weston et al., Table III).
///
/// For each angle the earlier raster g is rotated and correlated with the later one, f, at all
/// shifts within reach. The peak over the angles is interpolated, and the correlation is computed
/// again at that angle for the shift. Two angles share a complex transform, the spectrum of f is
/// computed once per pair, and only the shifts within reach are transformed back.
///
/// Planned once for rasters of n x n cells; nothing is allocated afterwards.
pub struct ExhaustiveSearch {
    n: usize,
    cell_m: f64,
    config: ExhaustiveConfig,
    angles: AngleGrid,
    correlation: KeptCorrelation,
    /// f and g, with values that are not finite set to zero.
    later: Vec<f32>,
    earlier: Vec<f32>,
    later_energy: OverlapEnergy,
    turned: [Turned; 2],
    candidates: Vec<Candidate>,
}

struct Turned {
    raster: Vec<f32>,
    energy: OverlapEnergy,
    scores: Scores,
}

/// The best match at one angle; the score is 0 without a match.
#[derive(Debug, Clone, Copy, Default)]
struct Candidate {
    score: f64,
    /// (x, y) of the motion, m.
    place: Vector2<f64>,
}

struct JointPeak {
    best: usize,
    angle_rad: f64,
    over_angles: LinePeak,
    /// The highest score at `angle_rad`, and the peak beside it in cells (down, right).
    highest: Shift,
    over_shifts: PlanePeak,
}

impl ExhaustiveSearch {
    /// Plans a search over rasters of `n` x `n` cells of `cell_m` metres.
    pub fn new(n: usize, cell_m: f64, config: &ExhaustiveConfig) -> Result<Self, SettingError> {
        let reach = reach_cells(n, cell_m, "exhaustive", config.reach_m)?;
        let size = fast_size(Scores::min_size(n, reach));
        let energy = || OverlapEnergy::new(n, Scores::around(reach));
        let turned = || Turned {
            raster: vec![0.0; n * n],
            energy: energy(),
            scores: Scores::new(reach, size),
        };
        let (angles, turned) = (config.angles(), [turned(), turned()]);
        Ok(Self {
            n,
            cell_m,
            config: config.clone(),
            angles,
            correlation: KeptCorrelation::new(n, size, turned[0].scores.wrapped.clone()),
            later: vec![0.0; n * n],
            earlier: vec![0.0; n * n],
            later_energy: energy(),
            turned,
            candidates: vec![Candidate::default(); angles.count],
        })
    }

    /// Finds the motion between two rasters, n x n, row 0 far ahead, column 0 far left. Values that
    /// are not finite count as zero.
    pub fn search(
        &mut self,
        later: ArrayView2<'_, f32>,
        earlier: ArrayView2<'_, f32>,
    ) -> Result<JointMatch, ShapeError> {
        let later = cells("later raster", &later, self.n)?;
        let earlier = cells("earlier raster", &earlier, self.n)?;
        kernels::finite_copy(later, &mut self.later);
        kernels::finite_copy(earlier, &mut self.earlier);
        self.later_energy.measure(&self.later);
        self.turned[0].energy.measure(&self.earlier);
        let energy = (self.later_energy.total * self.turned[0].energy.total).sqrt();
        if !(energy.is_finite() && energy > 0.0) {
            return Ok(self.no_match());
        }
        self.correlation.keep(&self.later);
        self.score_angles(energy);
        Ok(self
            .joint_peak(energy)
            .map_or_else(|| self.no_match(), |found| self.joint_match(&found)))
    }

    fn score_angles(&mut self, energy: f64) {
        for first in (0..self.angles.count).step_by(2) {
            let count = (self.angles.count - first).min(2);
            let angles = [0, 1].map(|k| self.angles.angle((first + k) as f64));
            self.score(angles, count, OFFSET, energy);
            for (k, turned) in self.turned.iter().take(count).enumerate() {
                self.candidates[first + k] = turned.best(self.config.peak, angles[k], self.cell_m);
            }
        }
    }

    fn score(&mut self, angles: [f64; 2], count: usize, offset: f64, energy: f64) {
        for (k, turned) in self.turned.iter_mut().enumerate() {
            if k < count {
                turned.turn(
                    &self.earlier,
                    self.n,
                    angles[k],
                    offset,
                    self.config.overlap,
                );
            } else {
                // An old raster here would change the last bits of the other result.
                turned.raster.fill(0.0);
            }
        }
        let [g, h] = &mut self.turned;
        let scale = (self.correlation.scale() / energy) as f32;
        self.correlation
            .correlate([&g.raster, &h.raster], |r, row| {
                g.scores.fill(r, row, |z| z.re * scale);
                if count == 2 {
                    h.scores.fill(r, row, |z| z.im * scale);
                }
            });
        for turned in self.turned.iter_mut().take(count) {
            turned.scores.normalise(
                self.config.overlap,
                &self.later_energy,
                &turned.energy,
                energy,
            );
        }
    }

    fn joint_peak(&mut self, energy: f64) -> Option<JointPeak> {
        let best = self.best()?;
        let over_angles = self.angle_peak(best);
        let angle_rad = self.angles.angle(best as f64 + over_angles.offset);
        self.score([angle_rad; 2], 1, 0.0, energy);
        let scores = &self.turned[0].scores;
        let highest = scores.highest()?;
        let over_shifts = scores.peak(self.config.peak, highest);
        Some(JointPeak {
            best,
            angle_rad,
            over_angles,
            highest,
            over_shifts,
        })
    }

    fn best(&self) -> Option<usize> {
        let best = (0..self.angles.count)
            .reduce(|best, k| if self.at(k) > self.at(best) { k } else { best })?;
        (self.at(best) > 0.0).then_some(best)
    }

    fn at(&self, k: usize) -> f64 {
        self.candidates[k].score
    }

    /// The interpolated peak over the angles; at the end of an open grid the best angle itself.
    fn angle_peak(&self, best: usize) -> LinePeak {
        if !self.angles.is_inner(best) {
            return LinePeak {
                offset: 0.0,
                value: self.at(best),
                curvature: 0.0,
            };
        }
        line_peak(self.config.peak, |by| self.at(self.angles.beside(best, by)))
    }

    fn angle_runner_up(&self, best: usize) -> Option<usize> {
        let summit = |k: usize| (-1..=1).all(|by| self.at(self.angles.beside(k, by)) <= self.at(k));
        let others =
            (0..self.angles.count).filter(|&k| !self.angles.are_close(best, k) && summit(k));
        others.filter(|&k| self.at(k) > 0.0).reduce(|second, k| {
            if self.at(k) > self.at(second) {
                k
            } else {
                second
            }
        })
    }

    fn joint_match(&self, found: &JointPeak) -> JointMatch {
        let score = found.over_shifts.value.min(1.0);
        let second = self.angle_runner_up(found.best);
        let rotation = RotationMatch {
            angle_rad: wrap_angle(found.angle_rad),
            variance_rad2: self.angle_variance(score, found.over_angles.curvature),
            score,
            runner_up: second.map(|k| RotationRunnerUp {
                angle_rad: wrap_angle(self.angles.angle(k as f64)),
                score: self.at(k),
            }),
        };
        let turn = Rotation2::new(found.angle_rad);
        let place = translation(found.angle_rad, found.over_shifts.offset, self.cell_m);
        let guess = guess(self.config.reach_m);
        let hessian = &found.over_shifts.hessian;
        let spread = shift_covariance(VARIANCE_SCALE, score, hessian, self.cell_m, guess);
        let motion = MotionMatch {
            x_m: place.x,
            y_m: place.y,
            yaw_rad: rotation.angle_rad,
            covariance: motion_covariance(
                &turn,
                spread,
                self.ridge_slope(found),
                rotation.variance_rad2,
            ),
            score,
            runner_up: self.runner_up(found, second),
        };
        JointMatch { rotation, motion }
    }

    /// (1 - score) over the curvature of the best scores along the angle, scaled as the shift's:
    /// the angle's variance whatever the shift is.
    fn angle_variance(&self, score: f64, curvature: f64) -> f64 {
        let variance =
            -VARIANCE_SCALE * (1.0 - score).max(1e-6) / curvature * self.angles.step.powi(2);
        if variance > 0.0 {
            variance.min(self.angles.guess())
        } else {
            self.angles.guess()
        }
    }

    /// The derivative of (x, y) by the angle along the ridge of the scores, m/rad.
    fn ridge_slope(&self, found: &JointPeak) -> Vector2<f64> {
        let beside = [-1, 1].map(|by| self.angles.beside(found.best, by));
        if !self.angles.is_inner(found.best) || beside.iter().any(|&k| self.at(k) <= 0.0) {
            return Vector2::zeros();
        }
        let [before, after] = beside.map(|k| self.candidates[k].place);
        let slope = (after - before) / (2.0 * self.angles.step);
        // No cell is farther from the sensor: a larger slope is a jump to another peak.
        let farthest = self.n as f64 * self.cell_m * FRAC_1_SQRT_2;
        if slope.norm() <= farthest {
            slope
        } else {
            Vector2::zeros()
        }
    }

    fn runner_up(&self, found: &JointPeak, other_angle: Option<usize>) -> Option<MotionRunnerUp> {
        let at = |place: Vector2<f64>, score| MotionRunnerUp {
            x_m: place.x,
            y_m: place.y,
            score,
        };
        let here = self.turned[0].scores.runner_up(found.highest);
        let here = here.map(|((i, j), score)| {
            let shift = Vector2::new(i as f64, j as f64);
            at(translation(found.angle_rad, shift, self.cell_m), score)
        });
        let there = other_angle.map(|k| at(self.candidates[k].place, self.at(k)));
        let higher = |a: MotionRunnerUp, b: MotionRunnerUp| if b.score > a.score { b } else { a };
        [here, there].into_iter().flatten().reduce(higher)
    }

    fn no_match(&self) -> JointMatch {
        let variance_rad2 = self.angles.guess();
        JointMatch {
            rotation: RotationMatch::none(0.0, variance_rad2),
            motion: MotionMatch::none(self.config.reach_m, 0.0, variance_rad2),
        }
    }
}

impl Turned {
    /// g'(x) = g(R x + o), so that f(x) ~ g'(x + R^T (t - o)); and its energy if the normalisation
    /// needs it.
    fn turn(&mut self, earlier: &[f32], n: usize, angle_rad: f64, offset: f64, overlap: Overlap) {
        let rotation = Rotation::new(n, angle_rad).with_offset([offset; 2]);
        self.raster
            .chunks_exact_mut(n)
            .enumerate()
            .for_each(|(r, row)| rotation.row(earlier, r, row));
        if overlap == Overlap::Energy {
            self.energy.measure(&self.raster);
        }
    }

    /// The best match of a raster that was rotated with [`OFFSET`].
    fn best(&self, kind: Peak, angle_rad: f64, cell_m: f64) -> Candidate {
        let Some(highest) = self.scores.highest() else {
            return Candidate::default();
        };
        let peak = self.scores.peak(kind, highest);
        let place = translation(angle_rad, peak.offset, cell_m);
        Candidate {
            score: peak.value,
            place: place - Vector2::repeat(OFFSET * cell_m),
        }
    }
}

/// t = R t' with t' the shift along the raster's axes, cells: rows run backward, columns to the
/// right.
fn translation(angle_rad: f64, shift: Vector2<f64>, cell_m: f64) -> Vector2<f64> {
    Rotation2::new(angle_rad) * shift * -cell_m
}
