//! Least squares for scale, bias and offset of a gyro, and for the drift of its clock.

use gyre_radar::median;
use nalgebra::{Matrix4, Vector4};

use super::{angles::Angles, search::Peak, turns::Turn};
use crate::{BLOCKS, Estimate, jackknife};

/// Solutions of the linearised residuals, at most, and the change of the offset that ends them, s.
const ROUNDS: usize = 30;
const CONVERGED_S: f64 = 1e-6;
/// Residuals beyond so many standard deviations count less: the radar is wrong now and then.
const USUAL_SIGMAS: f64 = 3.0;
/// Standard deviation over the median of the absolute deviation, of a normal distribution.
const OF_MEDIAN: f64 = 1.4826;
/// An offset farther than this from the peak counts as different, s.
const NEAR_S: f64 = 1.0;

/// Scale, bias (rad/s), offset (s), drift (s/s):
/// `yaw = scale * angle(time + offset) - bias * time`.
type Parameters = Vector4<f64>;
/// Which of them are solved for.
type Free = [bool; 4];

pub(crate) struct Fit {
    /// Scale, bias (rad/s) and offset (s) without a drift.
    pub(crate) parameters: [Estimate; 3],
    pub(crate) drift: Estimate,
    pub(crate) turns: usize,
}

impl Fit {
    /// Fits the turns around a peak; `None` if they do not determine the parameters, or determine a
    /// different offset than the peak's.
    /// Speeds have no bias: without one it stays zero.
    pub(crate) fn new(
        turns: &[Turn],
        angles: &Angles,
        peak: &Peak,
        has_bias: bool,
    ) -> Option<Self> {
        let (without_drift, with_drift) =
            ([true, has_bias, true, false], [true, has_bias, true, true]);
        let sign = peak.correlation.signum();
        let covered = |turn: &&Turn| {
            let delay_s = peak.delay_s;
            angles
                .between(turn.from_s + delay_s, turn.to_s + delay_s)
                .is_some()
        };
        let turns: Vec<Turn> = turns.iter().filter(covered).copied().collect();
        let problem = Problem {
            angles,
            axis: peak.axis,
            sign,
            middle_s: turns.get(turns.len() / 2)?.from_s,
            delay_s: peak.delay_s,
        };
        let count = turns.len();
        let without = |left_out: Option<usize>, free: Free| {
            let kept = (0..count).filter(|k| Some(k * BLOCKS / count) != left_out);
            let kept: Vec<Turn> = kept.map(|k| turns[k]).collect();
            problem.solve(&kept, free)
        };
        let estimates = |free: Free| jackknife(|left_out| without(left_out, free));
        let [scale, bias, late, _] = estimates(without_drift)?;
        Some(Self {
            parameters: [scale, bias, late],
            drift: estimates(with_drift).map_or(Estimate::UNKNOWN, |all| all[3]),
            turns: count,
        })
    }
}

struct Problem<'a> {
    angles: &'a Angles,
    axis: usize,
    sign: f64,
    /// The time when the offset equals the parameter, s.
    middle_s: f64,
    /// The offset to begin with, s.
    delay_s: f64,
}

impl Problem<'_> {
    fn solve(&self, turns: &[Turn], free: Free) -> Option<Parameters> {
        let mut at = Parameters::new(1.0, 0.0, self.delay_s, 0.0);
        for _ in 0..ROUNDS {
            let rows = self.rows(turns, &at);
            let sigma = OF_MEDIAN * median(rows.iter().map(|(residual, _)| residual.abs()))?;
            let (mut normal, mut right) = (Matrix4::zeros(), Vector4::zeros());
            for (residual, slopes) in &rows {
                let weight = 1.0 / (1.0 + (residual / (USUAL_SIGMAS * sigma.max(1e-9))).powi(2));
                normal += weight * slopes * slopes.transpose();
                right += weight * *residual * slopes;
            }
            for fixed in (0..4).filter(|k| !free[*k]) {
                normal.row_mut(fixed).fill(0.0);
                normal.column_mut(fixed).fill(0.0);
                normal[(fixed, fixed)] = 1.0;
                right[fixed] = 0.0;
            }
            let step = normal.cholesky()?.solve(&right);
            at += step;
            if (at[2] - self.delay_s).abs() > NEAR_S {
                return None;
            }
            if step[2].abs() < CONVERGED_S {
                break;
            }
        }
        Some(at)
    }

    /// The residual of each turn, and its slopes by the parameters.
    fn rows(&self, turns: &[Turn], at: &Parameters) -> Vec<(f64, Parameters)> {
        let [scale, bias, delay_s, drift] = (*at).into();
        let row = |turn: &Turn| {
            let delay_s = delay_s + drift * (turn.from_s - self.middle_s);
            let turned = self
                .angles
                .between(turn.from_s + delay_s, turn.to_s + delay_s)?;
            let angle = self.sign * turned.angle[self.axis];
            let time_s = turn.to_s - turn.from_s;
            let by_late = scale * self.sign * turned.by_late[self.axis];
            let by_drift = by_late * (turn.from_s - self.middle_s);
            let slopes = Parameters::new(angle, -time_s, by_late, by_drift);
            Some((turn.amount - (scale * angle - bias * time_s), slopes))
        };
        turns.iter().filter_map(row).collect()
    }
}
