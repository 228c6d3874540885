//! The method on one page.

use crate::{
    CalibrationError, Drive, Estimate, Fact, Track,
    facts::{FACTS, FactVector},
    parts::Pairs,
};

const ROUNDS: usize = 4;
/// A round whose change is below this share of the standard deviations is the last.
const CONVERGED: f64 = 0.5;
const MIN_PATH_M: f64 = 100.0;

#[derive(Clone, Debug)]
pub struct Calibration {
    /// Changes against the configured values, each in its fact's unit.
    pub changes: [Estimate; FACTS],
    pub pairs: usize,
    /// The last solution changed the facts by less than their standard deviations. Otherwise they
    /// are not to be trusted.
    pub has_settled: bool,
    pub track: Track,
}

/// Finds the facts under which the parts of the scans measure the same motions. Facts that the
/// drive does not determine stay as configured, and the others are estimated beside them.
/// `track` is the drive's mean track; `progress` is called some ten times a round.
pub fn calibrate(
    drive: &Drive,
    track: Track,
    progress: &dyn Fn(),
) -> Result<Calibration, CalibrationError> {
    let path_m = track.length_m();
    if path_m < MIN_PATH_M {
        let scans = drive.sweeps.len();
        return Err(CalibrationError::Unusable(format!(
            "{scans} scans over {path_m:.0} m are too few: the constants show over {MIN_PATH_M} m and more"
        )));
    }
    let pairs = Pairs::of(drive, &track, progress);
    let mut free = Fact::ALL.to_vec();
    let (mut changes, mut has_settled) = solve(&pairs, &free)?;
    loop {
        let is_useful = |fact: &Fact| changes[*fact as usize].sigma < fact.useful_sigma();
        let useful: Vec<Fact> = free.iter().copied().filter(is_useful).collect();
        if useful.is_empty() || useful.len() == free.len() {
            break;
        }
        free = useful;
        let found;
        (found, has_settled) = solve(&pairs, &free)?;
        for fact in &free {
            changes[*fact as usize] = found[*fact as usize];
        }
    }
    let pairs = pairs.len();
    Ok(Calibration {
        changes,
        pairs,
        has_settled,
        track,
    })
}

/// Returns the changes of the free facts, and whether they have settled.
fn solve(pairs: &Pairs<'_>, free: &[Fact]) -> Result<([Estimate; FACTS], bool), CalibrationError> {
    let undetermined = || {
        let reason = "the scans have too little in common to determine the constants: two scans 6 to 20 m apart do not overlap in all their parts";
        CalibrationError::Unusable(reason.to_owned())
    };
    let mut at = FactVector::zeros();
    let mut rounds = 0;
    loop {
        let found = pairs.solve(&at, free)?.ok_or_else(undetermined)?;
        let error = |fact: Fact| found[fact as usize].with_error(fact.error());
        let found = Fact::ALL.map(error);
        rounds += 1;
        let is_small = |found: &Estimate| found.value.abs() < CONVERGED * found.sigma;
        let has_settled = free.iter().all(|fact| is_small(&found[*fact as usize]));
        for fact in free {
            at[*fact as usize] += found[*fact as usize].value;
        }
        if has_settled || rounds == ROUNDS {
            let change = |fact: Fact| Estimate::new(at[fact as usize], found[fact as usize].sigma);
            return Ok((Fact::ALL.map(change), has_settled));
        }
    }
}

impl Calibration {
    /// Returns how much the parts of the scans differ as configured, and with a change of the
    /// facts. The unit is the usual difference as configured.
    pub(crate) fn differences(
        &self,
        drive: &Drive,
        change: &FactVector,
        progress: &dyn Fn(),
    ) -> Result<[f64; 2], CalibrationError> {
        let pairs = Pairs::of(drive, &self.track, progress);
        let configured = pairs.measure(&FactVector::zeros())?;
        let changed = pairs.measure(change)?;
        Ok([&configured, &changed].map(|differences| differences.size(&configured)))
    }
}
