//! The velocity on which most bearings agree: by vote, then by least squares with weights that what
//! contradicts loses (Tukey's biweight).

use gyre_geometry::samples::Evidence;
use nalgebra::{Matrix2, Vector2};

use super::{NoDoppler, rows::REACH, shifts::RowShifts};

/// Sideways velocities that are voted on, cells of shift: up to 5 m/s.
const SIDEWAYS: [f64; 5] = [-4.0, -2.0, 0.0, 2.0, 4.0];
/// Every third row is enough to vote: of both chirps.
const VOTING_STEP: usize = 3;
/// Peaks are searched within so many cells of the shift that is expected, round by round: the vote
/// is a cell off at most, in each direction.
const WINDOWS: [f64; 6] = [3.0, 3.0, 2.0, 2.0, 2.0, 2.0];
/// Standard deviations beyond which a bearing has no weight: with normal errors the efficiency is
/// 95 % of unweighted least squares.
const CUTOFF: f64 = 4.685;
/// Standard deviation over median absolute value of normal errors.
const SIGMA_OF_MEDIAN: f64 = 1.4826;
/// The least standard deviation of a shift, cells: smaller steps are rounding.
const MIN_SIGMA_CELLS: f64 = 0.02;
const MIN_BEARINGS: usize = 20;
/// The highest peak of so many of them must be at the velocity. One in twenty is by chance.
const MIN_AGREEING: f64 = 0.25;
/// Greatest distance of a highest peak from the velocity, cells.
const AGREES_CELLS: f64 = 1.5;
/// Distance of azimuths with independent errors: a vehicle 20 m away covers ten.
const DEPENDENT_AZIMUTHS: usize = 10;

#[derive(Debug, Default)]
pub(super) struct Fit {
    seen: Vec<Seen>,
    sizes: Vec<f64>,
}

#[derive(Clone, Copy, Debug)]
struct Seen {
    azimuth: usize,
    direction: Vector2<f64>,
    /// Measured approach less the fitted velocity's, m/s.
    residual_mps: f64,
    weight: f64,
}

impl Fit {
    pub fn velocity(&mut self, rows: &[RowShifts]) -> Result<Evidence, NoDoppler> {
        let bearings = rows.len();
        let too_few = |bearings| NoDoppler::TooFewBearings {
            bearings,
            needed: MIN_BEARINGS,
        };
        if bearings < MIN_BEARINGS {
            return Err(too_few(bearings));
        }
        let mut velocity = vote(rows);
        let mut cutoff_mps = 0.0;
        for window in WINDOWS {
            self.look(rows, &velocity, window);
            cutoff_mps = self.cutoff_mps(rows);
            velocity += self.step(cutoff_mps).ok_or(too_few(self.seen.len()))?;
        }
        self.look(rows, &velocity, WINDOWS[WINDOWS.len() - 1]);
        let agrees = |row: &&RowShifts| (row.top_lag - row.lag_of(&velocity)).abs() < AGREES_CELLS;
        let agreeing = rows.iter().filter(agrees).count();
        if (agreeing as f64) < MIN_AGREEING * bearings as f64 {
            return Err(NoDoppler::NoAgreement { agreeing, bearings });
        }
        let within = |seen: &&Seen| seen.residual_mps.abs() < cutoff_mps;
        let used = self.seen.iter().filter(within).count();
        let covariance = self.covariance(cutoff_mps).filter(|_| used >= MIN_BEARINGS);
        let covariance = covariance.ok_or(too_few(used))?;
        Ok(Evidence {
            samples: used as u64,
            interval_s: 0.0,
            value: velocity.into(),
            covariance: [covariance[(0, 0)], covariance[(0, 1)], covariance[(1, 1)]],
        })
    }

    fn look(&mut self, rows: &[RowShifts], velocity: &Vector2<f64>, window: f64) {
        self.seen.clear();
        self.seen.reserve(rows.len());
        self.seen.extend(rows.iter().filter_map(|row| {
            let expected = row.lag_of(velocity);
            let peak = row.peak_near(expected, window)?;
            Some(Seen {
                azimuth: row.azimuth,
                direction: row.direction,
                residual_mps: (peak.lag - expected) * row.mps_per_lag,
                weight: peak.height * peak.height,
            })
        }));
    }

    fn cutoff_mps(&mut self, rows: &[RowShifts]) -> f64 {
        self.sizes.clear();
        let sizes = self.seen.iter().map(|seen| seen.residual_mps.abs());
        self.sizes.extend(sizes);
        let middle = self.sizes.len() / 2;
        let least = MIN_SIGMA_CELLS * rows[0].mps_per_lag.abs();
        if self.sizes.is_empty() {
            return CUTOFF * least;
        }
        let (_, median, _) = self.sizes.select_nth_unstable_by(middle, f64::total_cmp);
        CUTOFF * (SIGMA_OF_MEDIAN * *median).max(least)
    }

    fn step(&self, cutoff_mps: f64) -> Option<Vector2<f64>> {
        let (mut information, mut sum) = (Matrix2::zeros(), Vector2::zeros());
        for seen in &self.seen {
            let weight = seen.weight * biweight(seen.residual_mps / cutoff_mps);
            information += seen.direction * seen.direction.transpose() * weight;
            sum += seen.direction * (seen.residual_mps * weight);
        }
        let step = information.cholesky()?.solve(&sum);
        step.iter().all(|it| it.is_finite()).then_some(step)
    }

    /// The covariance of the fit, from the scatter of its bearings, whose errors are correlated
    /// between neighbours: the sandwich of the M-estimate with Newey and West's (1987) weights over
    /// the azimuths between two of them.
    fn covariance(&self, cutoff_mps: f64) -> Option<Matrix2<f64>> {
        let (mut information, mut scatter) = (Matrix2::zeros(), Matrix2::zeros());
        let influence = |seen: &Seen| {
            let share = seen.residual_mps / cutoff_mps;
            seen.direction * (seen.weight * seen.residual_mps * biweight(share))
        };
        for (k, seen) in self.seen.iter().enumerate() {
            let share = seen.residual_mps / cutoff_mps;
            let slope = seen.weight * biweight_slope(share);
            information += seen.direction * seen.direction.transpose() * slope;
            let of_seen = influence(seen);
            scatter += of_seen * of_seen.transpose();
            let near = |other: &&Seen| other.azimuth - seen.azimuth <= DEPENDENT_AZIMUTHS;
            for other in self.seen[k + 1..].iter().take_while(near) {
                let apart = (other.azimuth - seen.azimuth) as f64;
                let share = 1.0 - apart / (DEPENDENT_AZIMUTHS + 1) as f64;
                let both = of_seen * influence(other).transpose() * share;
                scatter += both + both.transpose();
            }
        }
        let inverse = information.cholesky()?.inverse();
        let bearings = self.seen.len() as f64;
        let covariance = inverse * scatter * inverse * (bearings / (bearings - 2.0).max(1.0));
        let is_one = covariance.iter().all(|it| it.is_finite()) && covariance.cholesky().is_some();
        is_one.then_some(covariance)
    }
}

fn vote(rows: &[RowShifts]) -> Vector2<f64> {
    let cell_mps = rows[0].mps_per_lag.abs();
    let reach = REACH as i32;
    let mut best = (Vector2::zeros(), f32::NEG_INFINITY);
    for ahead in -reach..=reach {
        for sideways in SIDEWAYS {
            let velocity = Vector2::new(f64::from(ahead), sideways) * cell_mps;
            let voters = rows.iter().step_by(VOTING_STEP);
            let sum: f32 = voters.map(|row| row.at(row.lag_of(&velocity))).sum();
            if sum > best.1 {
                best = (velocity, sum);
            }
        }
    }
    best.0
}

fn biweight(share: f64) -> f64 {
    let rest = (1.0 - share * share).max(0.0);
    rest * rest
}

fn biweight_slope(share: f64) -> f64 {
    let square = share * share;
    match square < 1.0 {
        true => (1.0 - square) * (1.0 - 5.0 * square),
        false => 0.0,
    }
}
