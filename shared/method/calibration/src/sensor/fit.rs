//! Least squares for scale, bias and offset of a sensor, and for the drift of its clock.

use gyre_radar::median;
use nalgebra::{Matrix4, Vector4};

use super::{
    log::{Log, Stretch},
    search::Peak,
};
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
/// `amount = scale * logged(time + offset) - bias * time`.
type Parameters = Vector4<f64>;
/// Which of them are solved for.
type Free = [bool; 4];

pub(super) struct Fit {
    /// Scale, bias (rad/s) and offset (s) without a drift.
    pub(super) parameters: [Estimate; 3],
    pub(super) drift: Estimate,
    pub(super) count: usize,
}

impl Fit {
    /// Fits the stretches around a peak; `None` if they do not determine the parameters, or
    /// determine a different offset than the peak's. Speeds have no bias: without one it stays
    /// zero.
    pub(super) fn new(
        stretches: &[Stretch],
        log: &Log,
        peak: &Peak,
        has_bias: bool,
    ) -> Option<Self> {
        let covered = |it: &&Stretch| log.over(it, peak.delay_s).is_some();
        let stretches: Vec<Stretch> = stretches.iter().filter(covered).copied().collect();
        let count = stretches.len();
        let problem = Problem {
            log,
            axis: peak.axis,
            sign: peak.correlation.signum(),
            middle_s: stretches.get(count / 2)?.from_s,
            delay_s: peak.delay_s,
        };
        let without = |left_out: Option<usize>, free: Free| {
            let kept = (0..count).filter(|k| Some(k * BLOCKS / count) != left_out);
            let kept: Vec<Stretch> = kept.map(|k| stretches[k]).collect();
            problem.solve(&kept, free)
        };
        let estimates = |has_drift: bool| {
            let free = [true, has_bias, true, has_drift];
            jackknife(|left_out| without(left_out, free))
        };
        let [scale, bias, late, _] = estimates(false)?;
        Some(Self {
            parameters: [scale, bias, late],
            drift: estimates(true).map_or(Estimate::UNKNOWN, |all| all[3]),
            count,
        })
    }
}

struct Problem<'a> {
    log: &'a Log,
    axis: usize,
    sign: f64,
    /// The time when the offset equals the parameter, s.
    middle_s: f64,
    /// The offset to begin with, s.
    delay_s: f64,
}

impl Problem<'_> {
    fn solve(&self, stretches: &[Stretch], free: Free) -> Option<Parameters> {
        let mut at = Parameters::new(1.0, 0.0, self.delay_s, 0.0);
        for _ in 0..ROUNDS {
            let rows = self.rows(stretches, &at);
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

    /// The residual of each stretch, and its slopes by the parameters.
    fn rows(&self, stretches: &[Stretch], at: &Parameters) -> Vec<(f64, Parameters)> {
        let [scale, bias, delay_s, drift] = (*at).into();
        let row = |stretch: &Stretch| {
            let since_s = stretch.from_s - self.middle_s;
            let logged = self.log.over(stretch, delay_s + drift * since_s)?;
            let amount = self.sign * logged.amount[self.axis];
            let time_s = stretch.to_s - stretch.from_s;
            let by_late = scale * self.sign * logged.by_late[self.axis];
            let slopes = Parameters::new(amount, -time_s, by_late, by_late * since_s);
            Some((stretch.amount - (scale * amount - bias * time_s), slopes))
        };
        stretches.iter().filter_map(row).collect()
    }
}
