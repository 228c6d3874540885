//! The constants that were found, beside the configured ones, and the evidence for each.

mod constant;
#[cfg(test)]
mod tests;

use std::fmt;

use gyre_geometry::SweepGeometry;

use crate::{Calibration, CalibrationError, Drive, FACTS, Fact, FactVector, OwnReflections};
pub use constant::Constant;
use constant::{Label, constant, resolution};

/// The configuration of the drive before it is calibrated.
pub struct Configured {
    /// The constants that were used to read the scans.
    pub geometry: SweepGeometry,
    /// The eccentricity of the encoder that was used to read them, rad.
    pub eccentricity_rad: f64,
    pub min_range_m: f64,
    /// Length of the path by another sensor, m.
    pub distance_m: Option<f64>,
}

/// The key in `[dataset]`, the name, the unit for printing and the factor to it of each constant in
/// the order of [`Fact::ALL`].
const LABELS: [Label; FACTS] = [
    ("range_offset_m", "range offset", "m", 1.0),
    (
        "azimuth_eccentricity_rad",
        "encoder eccentricity",
        "mrad",
        1e3,
    ),
    ("doppler_s", "Doppler shift", "s", 1.0),
];

pub struct Found {
    pub scans: usize,
    pub path_m: f64,
    has_settled: bool,
    /// Mean overlap of scans of one place as configured, and with the drive's findings.
    overlap: [f64; 2],
    /// The constants but for the range resolution.
    pub constants: Vec<Constant>,
    /// The range resolution, if the length of the path is given.
    resolution: Result<Constant, String>,
    /// Range that leaves out the vehicle's own reflections, m, if it is more than configured.
    pub min_range_m: Option<f64>,
    reflections: Option<String>,
}

impl Found {
    /// Compares the findings with the configuration.
    pub fn new(
        drive: &Drive,
        calibration: &Calibration,
        configured: &Configured,
    ) -> Result<Self, CalibrationError> {
        let path_m = calibration.after.path_m().last().copied();
        let path_m = path_m.unwrap_or_default();
        let geometry = &configured.geometry;
        // If the scans contain the direction of chirps, its sign is the chirp's.
        let doppler_s = match (drive.alternates, f64::from(geometry.doppler_s)) {
            (true, configured) => configured.abs(),
            (false, configured) => configured,
        };
        let values: [f64; FACTS] = [
            geometry.range_offset_m.into(),
            configured.eccentricity_rad,
            doppler_s,
        ];
        let constants =
            (0..FACTS).map(|k| constant(LABELS[k], values[k], &calibration.facts[k], calibration));
        Ok(Self {
            scans: drive.sweeps.len(),
            path_m,
            has_settled: calibration.has_settled,
            overlap: calibration.overlap,
            constants: constants.collect(),
            resolution: resolution(path_m, configured)?,
            min_range_m: drive.reflections.min_range_m(configured.min_range_m),
            reflections: Some(reflections(&drive.reflections, configured.min_range_m)),
        })
    }

    /// Returns the means over several drives, each weighted by its uncertainty, with their overlap
    /// yet to be compared. Each drive keeps the rest in its own findings.
    pub(crate) fn mean(all: &[&Self]) -> Self {
        let drives = || all.iter();
        let constants = (0..all[0].constants.len()).map(|k| {
            let of_drives: Vec<_> = drives().map(|it| &it.constants[k]).collect();
            Constant::mean(&of_drives)
        });
        Self {
            scans: drives().map(|it| it.scans).sum(),
            path_m: drives().map(|it| it.path_m).sum(),
            has_settled: drives().all(|it| it.has_settled),
            overlap: [0.0; 2],
            constants: constants.collect(),
            resolution: Err("as configured: --distance-m tells it from one drive alone".to_owned()),
            min_range_m: drives().filter_map(|it| it.min_range_m).reduce(f64::max),
            reflections: None,
        }
    }

    pub(crate) fn change(&self) -> FactVector {
        let mut change = FactVector::zeros();
        for (fact, constant) in Fact::ALL.into_iter().zip(&self.constants) {
            if constant.is_proposed {
                change[fact as usize] = constant.found.value - constant.configured;
            }
        }
        change
    }

    /// Takes the overlap as configured and as proposed; a lower overlap revokes the proposal.
    pub(crate) fn compared(mut self, overlap: [f64; 2]) -> Self {
        self.overlap = overlap;
        if overlap[1] < overlap[0] {
            for constant in &mut self.constants {
                constant.is_proposed = false;
            }
        }
        self
    }

    pub fn proposed(&self) -> impl Iterator<Item = &Constant> {
        let solved = self
            .constants
            .iter()
            .filter(|constant| constant.is_proposed);
        solved.chain(self.resolution.as_ref().ok())
    }

    pub fn kept(&self) -> impl Iterator<Item = &Constant> {
        self.constants
            .iter()
            .filter(|constant| !constant.is_proposed)
    }

    pub fn overlap(&self) -> String {
        let [before, after] = self.overlap;
        let with = match after < before {
            true => "with what was found, which is less: it is not proposed",
            false if self.constants.iter().any(|it| it.is_proposed) => "with what is proposed",
            false => "after: no constant that it determines is proposed",
        };
        format!("overlap of the scans  {before:.4} as configured, {after:.4} {with}")
    }
}

fn reflections(own: &OwnReflections, configured_m: f64) -> String {
    match (own.end_m(), own.min_range_m(configured_m)) {
        (None, _) => "too few moving scans to tell them".to_owned(),
        (Some(end_m), _) if end_m >= OwnReflections::REACH_M => format!(
            "power everywhere within {end_m:.0} m in nine of ten moving scans: raise masking.threshold to tell them"
        ),
        (Some(end_m), Some(min_range_m)) => format!(
            "to {end_m:.2} m in nine of ten moving scans, beyond points.min_range_m = {configured_m}: that and raster.min_range_m are to be {min_range_m:.1}"
        ),
        (Some(end_m), None) => {
            format!("to {end_m:.2} m, within points.min_range_m = {configured_m}")
        }
    }
}

impl fmt::Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{} scans, {:.0} m", self.scans, self.path_m)?;
        if !self.has_settled {
            write!(
                f,
                "\nthe constants have not settled: take a longer drive, or begin with constants that are nearer"
            )?;
        }
        for constant in self.constants.iter().chain(self.resolution.as_ref().ok()) {
            write!(f, "\n{constant}")?;
        }
        if let Err(reason) = &self.resolution {
            write!(f, "\n{:<21} {reason}", "range resolution")?;
        }
        if let Some(sentence) = &self.reflections {
            write!(f, "\n{:<21} {sentence}", "own reflections")?;
        }
        Ok(())
    }
}
