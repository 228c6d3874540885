use std::fmt;

use super::Configured;
use crate::{Calibration, CalibrationError, Estimate, FactEstimate};

/// The given length of the path over that by the scans: beyond, it is of another drive, or scans
/// are missing.
const PLAUSIBLE_RATIO: std::ops::RangeInclusive<f64> = 0.8..=1.25;
/// Least relative difference of the path between both directions of time: the error of its length.
const PATH_ERROR: f64 = 1e-3;

/// Key, name, unit for printing, and factor to that unit.
pub(crate) type Label = (&'static str, &'static str, &'static str, f64);

#[derive(Clone)]
pub struct Constant {
    /// Key in the section `[dataset]`, name, unit for printing, and factor to that unit.
    pub(crate) label: Label,
    pub configured: f64,
    pub found: Estimate,
    /// The standard deviation above which a drive adds nothing to the prior knowledge about any
    /// radar.
    pub(super) useful_sigma: f64,
    /// The solution has settled, so that the value can be trusted.
    pub(super) has_settled: bool,
    /// It is written into the section for the configuration.
    pub is_proposed: bool,
    pub basis: String,
}

impl Constant {
    /// Returns whether the drive adds knowledge.
    pub fn is_determined(&self) -> bool {
        self.has_settled && self.found.sigma < self.useful_sigma
    }

    /// Returns the mean over several drives of one radar. It is proposed if they determine it
    /// together, and none of them rejects its own estimate.
    pub(super) fn mean(all: &[&Self]) -> Self {
        let drives = || all.iter();
        let found = drives()
            .skip(1)
            .fold(all[0].found, |mean, next| mean.combined(&next.found));
        let basis = drives().map(|it| it.found.times(it.label.3).to_string());
        let mut mean = Self {
            found,
            has_settled: drives().all(|it| it.has_settled),
            basis: format!("of the drives {}", basis.collect::<Vec<_>>().join("; ")),
            ..all[0].clone()
        };
        mean.is_proposed =
            mean.is_determined() && drives().all(|it| it.is_proposed || !it.is_determined());
        mean
    }
}

pub(super) fn constant(
    label: Label,
    configured: f64,
    fact: &FactEstimate,
    calibration: &Calibration,
) -> Constant {
    let found = Estimate::new(configured + fact.change.value, fact.change.sigma);
    let part = |estimate: &Estimate| {
        let part = Estimate::new(configured + estimate.value, estimate.sigma).times(label.3);
        format!("{part:.3}")
    };
    let basis = match (&fact.by_drift, calibration.revisits.is_empty()) {
        (Some(drift), _) => format!(
            "overlap {}; drift between {} revisits {}",
            part(&fact.by_overlap),
            calibration.revisits.len(),
            part(drift)
        ),
        (None, true) => format!(
            "overlap of {} pairs of scans alone: no revisit in this drive",
            calibration.pairs
        ),
        (None, false) => format!(
            "overlap of {} pairs of scans, {} of them revisits",
            calibration.pairs,
            calibration.revisits.len()
        ),
    };
    Constant {
        label,
        configured,
        found,
        useful_sigma: fact.fact.useful_sigma(),
        has_settled: calibration.has_settled,
        is_proposed: calibration.proposed.contains(&fact.fact),
        basis,
    }
}

/// The range resolution from the length of the path, or the reason why the drive cannot determine
/// it.
pub(super) fn resolution(
    path_m: f64,
    configured: &Configured,
) -> Result<Result<Constant, String>, CalibrationError> {
    let resolution_m = f64::from(configured.geometry.range_resolution_m);
    let Some(distance_m) = configured.distance_m else {
        return Ok(Err(format!(
            "{resolution_m:.5} m as configured: a drive alone cannot tell it, since a larger world driven through faster looks the same; \
             the path is {path_m:.1} m: give its length by an odometer or GNSS with --distance-m"
        )));
    };
    let ratio = distance_m / path_m;
    if !PLAUSIBLE_RATIO.contains(&ratio) {
        return Err(CalibrationError::Unusable(format!(
            "--distance-m is {distance_m:.1}, but the path of the scans is {path_m:.1} m: give the length of this drive, from its first scan to its last"
        )));
    }
    let value = resolution_m * ratio;
    Ok(Ok(Constant {
        label: ("range_resolution_m", "range resolution", "m", 1.0),
        configured: resolution_m,
        found: Estimate::new(value, value * PATH_ERROR),
        useful_sigma: f64::INFINITY,
        has_settled: true,
        is_proposed: true,
        basis: format!(
            "{distance_m:.1} m given for {path_m:.1} m of path, with the constants as found"
        ),
    }))
}

impl fmt::Display for Constant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let verdict = match (self.is_determined(), self.is_proposed) {
            (false, _) => "the scans do not tell it well enough",
            (true, false) => "not proposed: the scans would overlap less",
            _ if self.found.contradicts(self.configured) => "CONTRADICTS the configured value",
            _ => "agrees with the configured value",
        };
        let (_, name, unit, scale) = self.label;
        let (found, configured) = (self.found.times(scale), self.configured * scale);
        write!(
            f,
            "{name:<21} {found} {unit}, configured {configured:.4}: {verdict}\n{:<21} {}",
            "", self.basis
        )
    }
}
