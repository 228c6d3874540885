//! The method on one page.

use gyre_matching::SettingError;
use nalgebra::DVector;

use crate::{
    CalibrationError, Drive, Estimate, Fact, FactVector, Revisit, Track,
    drift::{self, MAX_REVISITS},
    facts::FACTS,
    overlap::{System, along, overlaps, slopes},
    revisits,
};

const ROUNDS: usize = 4;
/// A round whose change is below this share of the standard deviations is the last.
const CONVERGED: f64 = 0.5;
/// Change of the eccentricity for the slope of the drift, rad: large, since two tracks differ by
/// chance too.
const DRIFT_STEP_RAD: f64 = 3e-3;
/// No estimate is better than this share of a cell of the local map, or its effect at the range of
/// most points: the images' own error.
const CELL_SHARE: f64 = 0.05;
const USUAL_RANGE_M: f64 = 30.0;
const USUAL_SPEED_MPS: f64 = 10.0;
const MIN_REVISITS: usize = 5;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct FactEstimate {
    pub fact: Fact,
    /// Change against the configured value, in the fact's unit.
    pub change: Estimate,
    pub by_overlap: Estimate,
    /// The estimate from the drift between revisits alone, if there are any.
    pub by_drift: Option<Estimate>,
}

impl FactEstimate {
    pub fn is_useful(&self) -> bool {
        self.change.sigma < self.fact.useful_sigma()
    }
}

#[derive(Clone, Debug)]
pub struct Calibration {
    /// All facts in their order.
    pub facts: [FactEstimate; FACTS],
    pub revisits: Vec<Revisit>,
    pub pairs: usize,
    /// The last solution changed the facts by less than their standard deviations. Otherwise they
    /// are not to be trusted.
    pub has_settled: bool,
    /// The facts that are corrected: those that the drive determines, if the scans overlap more
    /// with all of them.
    pub proposed: Vec<Fact>,
    /// Mean overlap of the pairs as configured, and with the facts that the drive determines.
    pub overlap: [f64; 2],
    /// The track as configured, and the one with the proposed facts.
    pub before: Track,
    pub after: Track,
}

impl Calibration {
    /// Returns the mean overlap of the pairs as configured, and with these changes of the facts.
    pub(crate) fn overlap_with(
        &self,
        drive: &Drive,
        change: &FactVector,
    ) -> Result<[f64; 2], CalibrationError> {
        let after = drive.mean_track_with(change)?;
        let pairs = pairs(&self.before, &self.revisits);
        Ok(overlaps(drive, &pairs, [&self.before, &after]))
    }
}

pub fn calibrate(drive: &Drive) -> Result<Calibration, CalibrationError> {
    let before = drive.mean_track()?;
    let path_m = before.path_m().last().copied().unwrap_or_default();
    if path_m < 100.0 {
        let scans = drive.sweeps.len();
        return Err(CalibrationError::Unusable(format!(
            "{scans} scans over {path_m:.0} m are too few: the constants show over 100 m and more, so give a longer recording or a larger --scans"
        )));
    }
    let revisits = evenly(revisits::find(drive, &before)?, &before);
    let mut solution = Solution::find(drive, &before, &revisits, &Fact::ALL)?;
    let mut facts = solution.facts;
    let mut proposed = solution.determined();
    // Facts that the drive does not determine stay as configured, and the others are estimated
    // beside them.
    while !proposed.is_empty() && proposed.len() < solution.round.free.len() {
        solution = Solution::find(drive, &before, &revisits, &proposed)?;
        for &fact in &proposed {
            facts[fact as usize] = solution.facts[fact as usize];
        }
        proposed = solution.determined();
    }
    let mut change = FactVector::zeros();
    for &fact in &proposed {
        change[fact as usize] = facts[fact as usize].change.value;
    }
    let mut after = drive.mean_track_with(&change)?;
    let pairs = pairs(&before, &revisits);
    let overlap = overlaps(drive, &pairs, [&before, &after]);
    if overlap[1] < overlap[0] {
        proposed.clear();
        after = before.clone();
    }
    Ok(Calibration {
        facts,
        pairs: solution.round.pairs,
        has_settled: solution.round.has_converged(),
        revisits,
        proposed,
        overlap,
        before,
        after,
    })
}

/// The facts that fit best while the others stay as configured.
struct Solution {
    facts: [FactEstimate; FACTS],
    round: Round,
}

impl Solution {
    fn find(
        drive: &Drive,
        before: &Track,
        revisits: &[Revisit],
        free: &[Fact],
    ) -> Result<Self, CalibrationError> {
        let mut at = before.clone();
        let mut found = round(drive, &at, revisits, free)?;
        for _ in 1..ROUNDS {
            if found.has_converged() {
                break;
            }
            at = drive.mean_track_with(&(at.change + found.step()))?;
            found = round(drive, &at, revisits, free)?;
        }
        let by_drift = match free.contains(&Fact::Eccentricity) {
            true => drift_of(drive, &at, revisits)?,
            false => None,
        };
        Ok(Self {
            facts: facts(drive, &found, &at.change, by_drift),
            round: found,
        })
    }

    /// Returns the facts that the drive determines; none if they have not settled.
    fn determined(&self) -> Vec<Fact> {
        let is_useful = |fact: &&Fact| self.facts[**fact as usize].is_useful();
        match self.round.has_converged() {
            true => self.round.free.iter().filter(is_useful).copied().collect(),
            false => Vec::new(),
        }
    }
}

struct Round {
    free: Vec<Fact>,
    solved: [Estimate; FACTS],
    pairs: usize,
}

impl Round {
    fn has_converged(&self) -> bool {
        let small = |estimate: &Estimate| estimate.value.abs() < CONVERGED * estimate.sigma;
        let mut free = self.free.iter();
        free.all(|fact| small(&self.solved[*fact as usize]))
    }

    fn step(&self) -> FactVector {
        FactVector::from_fn(|k, _| self.solved[k].value)
    }
}

/// At most [`MAX_REVISITS`] with an unbroken track between, evenly spread.
fn evenly(mut revisits: Vec<Revisit>, track: &Track) -> Vec<Revisit> {
    revisits.retain(|revisit| !track.is_broken(revisit.earlier, revisit.later));
    let stride = revisits.len().div_ceil(MAX_REVISITS).max(1);
    revisits.into_iter().step_by(stride).collect()
}

fn pairs(track: &Track, revisits: &[Revisit]) -> Vec<Revisit> {
    let mut pairs = along(track);
    pairs.extend_from_slice(revisits);
    pairs
}

fn round(
    drive: &Drive,
    track: &Track,
    revisits: &[Revisit],
    free: &[Fact],
) -> Result<Round, CalibrationError> {
    let system = System::measure(drive, track, &pairs(track, revisits));
    let undetermined = || {
        let reason = "the scans have too little in common to determine the constants: their overlap has no maximum near the configured ones";
        CalibrationError::Unusable(reason.to_owned())
    };
    Ok(Round {
        free: free.to_vec(),
        solved: system.solve(free).ok_or_else(undetermined)?,
        pairs: system.len(),
    })
}

/// Estimates the eccentricity from the drift between revisits, as a change against the configured
/// one.
fn drift_of(
    drive: &Drive,
    at: &Track,
    revisits: &[Revisit],
) -> Result<Option<Estimate>, SettingError> {
    if revisits.len() < MIN_REVISITS {
        return Ok(None);
    }
    let shifted = |by_rad: f64| -> Result<DVector<f64>, SettingError> {
        let mut shifted = at.change;
        shifted[Fact::Eccentricity as usize] += by_rad;
        let track = drive.mean_track_with(&shifted)?;
        Ok(drift::residuals(&track, &aligned(drive, &track, revisits)))
    };
    let slopes = (shifted(DRIFT_STEP_RAD)? - shifted(-DRIFT_STEP_RAD)?) / (2.0 * DRIFT_STEP_RAD);
    let here = aligned(drive, at, revisits);
    let found = drift::solve(at, &here, &drift::residuals(at, &here), &slopes);
    let configured = at.change[Fact::Eccentricity as usize];
    Ok(found.map(|found| Estimate::new(found.value + configured, found.sigma)))
}

fn aligned(drive: &Drive, track: &Track, revisits: &[Revisit]) -> Vec<Revisit> {
    let poses = revisits.iter().zip(slopes(drive, track, revisits));
    poses
        .map(|(revisit, slope)| Revisit {
            pose: slope.map_or(revisit.pose, |slope| slope.pose),
            ..*revisit
        })
        .collect()
}

fn facts(
    drive: &Drive,
    found: &Round,
    change: &FactVector,
    by_drift: Option<Estimate>,
) -> [FactEstimate; FACTS] {
    let error_m = CELL_SHARE * drive.config().refinement.cell_m;
    Fact::ALL.map(|fact| {
        let k = fact as usize;
        let floor = match fact {
            Fact::RangeOffset => error_m,
            Fact::Eccentricity => error_m / USUAL_RANGE_M,
            Fact::Doppler => error_m / USUAL_SPEED_MPS,
        };
        let solved = found.solved[k];
        let by_overlap = Estimate::new(solved.value + change[k], solved.sigma.hypot(floor));
        let by_drift = by_drift.filter(|_| fact == Fact::Eccentricity);
        let change = by_drift.map_or(by_overlap, |by_drift| by_overlap.combined(&by_drift));
        FactEstimate {
            fact,
            change,
            by_overlap,
            by_drift,
        }
    })
}
