//! The constants that were found beside the configured ones, and the file with those that are
//! wrong.

#[cfg(test)]
mod tests;

use std::fmt::{self, Write};

use gyre_geometry::SweepGeometry;

use crate::{
    Calibration, CalibrationError, Drive, Estimate, FACTS, Fact, OwnReflections, Track, calibrate,
    facts::FactVector,
};

/// The given length of the path over that by the scans: beyond, it is of another drive, or scans
/// are missing.
const PLAUSIBLE_RATIO: std::ops::RangeInclusive<f64> = 0.8..=1.25;
/// Least relative difference of the path between both directions of time: the error of its length.
const PATH_ERROR: f64 = 1e-3;

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

/// Key in `[dataset]`, name, unit for printing, and factor to that unit.
type Label = (&'static str, &'static str, &'static str, f64);

/// In the order of [`Fact::ALL`].
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
const RESOLUTION: Label = ("range_resolution_m", "range resolution", "mm", 1e3);

#[derive(Clone)]
struct Constant {
    label: Label,
    configured: f64,
    found: Estimate,
    verdict: Verdict,
}

#[derive(Clone, Copy, PartialEq)]
enum Verdict {
    Undetermined,
    Agrees,
    Contradicts,
    /// It contradicts the configured value, but with it the parts of the scans differ more.
    Worse,
}

/// A drive with its findings.
pub struct Study {
    drive: Drive,
    calibration: Calibration,
    pub found: Found,
}

pub struct Found {
    scans: usize,
    path_m: f64,
    pairs: usize,
    has_settled: bool,
    constants: Vec<Constant>,
    /// The size of the differences between the parts of the scans as configured, and with the
    /// constants that contradict it, if there are any.
    differences: Option<[f64; 2]>,
    /// The range resolution, if the length of the path is given.
    resolution: Option<Constant>,
    /// Sentences about the range resolution and the vehicle's own reflections.
    notes: Vec<(&'static str, String)>,
}

impl Study {
    /// Calibrates a drive with its mean track; `progress` is called every few seconds.
    pub fn new(
        drive: Drive,
        track: Track,
        configured: &Configured,
        progress: &dyn Fn(),
    ) -> Result<Self, CalibrationError> {
        let calibration = calibrate(&drive, track, progress)?;
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
        let constant = |fact: Fact| {
            let (k, change) = (fact as usize, calibration.changes[fact as usize]);
            let found = Estimate::new(values[k] + change.value, change.sigma);
            Constant::new(fact, values[k], found, calibration.has_settled)
        };
        let mut found = Found {
            scans: drive.sweeps.len(),
            path_m: calibration.track.length_m(),
            pairs: calibration.pairs,
            has_settled: calibration.has_settled,
            constants: Fact::ALL.map(constant).to_vec(),
            differences: None,
            resolution: None,
            notes: Vec::new(),
        };
        found.compare(|change| calibration.differences(&drive, change, progress))?;
        found.resolve(configured, &drive)?;
        let own = reflections(&drive.reflections, configured.min_range_m);
        found.notes.push(("own reflections", own));
        Ok(Self {
            drive,
            calibration,
            found,
        })
    }

    /// Combines the findings of several drives of one radar, each weighted by its uncertainty.
    pub fn combined(studies: &[Self]) -> Result<Found, CalibrationError> {
        let drives = || studies.iter().map(|study| &study.found);
        let has_settled = drives().all(|it| it.has_settled);
        let constant = |fact: Fact| {
            let all = drives().map(|it| it.constants[fact as usize].found);
            let found = all.reduce(|mean, next| mean.combined(&next));
            let found = found.unwrap_or(Estimate::UNKNOWN);
            let configured = studies[0].found.constants[fact as usize].configured;
            Constant::new(fact, configured, found, has_settled)
        };
        let mut found = Found {
            scans: drives().map(|it| it.scans).sum(),
            path_m: drives().map(|it| it.path_m).sum(),
            pairs: drives().map(|it| it.pairs).sum(),
            has_settled,
            constants: Fact::ALL.map(constant).to_vec(),
            differences: None,
            resolution: None,
            notes: Vec::new(),
        };
        let pairs = found.pairs as f64;
        found.compare(|change| {
            studies.iter().try_fold([0.0; 2], |sum, study| {
                let (of_drive, share) = (&study.calibration, study.found.pairs as f64 / pairs);
                let differences = of_drive.differences(&study.drive, change, &|| ())?;
                Ok([0, 1].map(|k| sum[k] + share * differences[k]))
            })
        })?;
        Ok(found)
    }
}

impl Constant {
    fn new(fact: Fact, configured: f64, found: Estimate, has_settled: bool) -> Self {
        let is_determined = has_settled && found.sigma < fact.useful_sigma();
        Self {
            label: LABELS[fact as usize],
            configured,
            found,
            verdict: match (is_determined, found.contradicts(configured)) {
                (false, _) => Verdict::Undetermined,
                (true, false) => Verdict::Agrees,
                (true, true) => Verdict::Contradicts,
            },
        }
    }
}

impl Found {
    /// The change of the constants that contradict the configured ones.
    fn change(&self) -> FactVector {
        FactVector::from_fn(|k, _| match self.constants.get(k) {
            Some(it) if it.verdict == Verdict::Contradicts => it.found.value - it.configured,
            _ => 0.0,
        })
    }

    /// Measures the size of the differences between the parts of the scans as configured, and with
    /// a change of the facts. Constants that increase the differences are not written.
    fn compare(
        &mut self,
        differences: impl FnOnce(&FactVector) -> Result<[f64; 2], CalibrationError>,
    ) -> Result<(), CalibrationError> {
        let change = self.change();
        if change == FactVector::zeros() {
            return Ok(());
        }
        let [before, after] = differences(&change)?;
        self.differences = Some([before, after]);
        if after > before {
            let found = self.constants.iter_mut();
            found
                .filter(|it| it.verdict == Verdict::Contradicts)
                .for_each(|it| it.verdict = Verdict::Worse);
        }
        Ok(())
    }

    /// Takes the range resolution from the length of the path.
    fn resolve(&mut self, configured: &Configured, drive: &Drive) -> Result<(), CalibrationError> {
        let resolution_m = f64::from(configured.geometry.range_resolution_m);
        let Some(distance_m) = configured.distance_m else {
            let note = format!(
                "{resolution_m:.5} m as configured: a drive alone cannot determine it, since a larger world driven through faster looks the same; \
                 the path is {:.1} m: give its length by an odometer or GNSS with --distance-m",
                self.path_m
            );
            self.notes.push((RESOLUTION.1, note));
            return Ok(());
        };
        let (track, _) = drive.mean_track_with(&self.change())?;
        let path_m = track.length_m();
        self.path_m = path_m;
        let ratio = distance_m / path_m;
        if !PLAUSIBLE_RATIO.contains(&ratio) {
            return Err(CalibrationError::Unusable(format!(
                "--distance-m is {distance_m:.1}, but the path of the scans is {path_m:.1} m: give the length of this drive, from its first scan to its last"
            )));
        }
        let found = Estimate::new(resolution_m * ratio, resolution_m * ratio * PATH_ERROR);
        self.resolution = Some(Constant {
            label: RESOLUTION,
            configured: resolution_m,
            found,
            verdict: match found.contradicts(resolution_m) {
                true => Verdict::Contradicts,
                false => Verdict::Agrees,
            },
        });
        Ok(())
    }

    /// Returns whether the drive agrees with the configured constants: a value that is too
    /// uncertain to be used may contradict them too. `None` if it determines none of them.
    pub fn agrees(&self) -> Option<bool> {
        let mut constants = self.constants.iter();
        let contradicts = |it: &Constant| it.found.contradicts(it.configured);
        match constants.clone().any(contradicts) {
            true => Some(false),
            false => constants
                .any(|it| it.verdict == Verdict::Agrees)
                .then_some(true),
        }
    }

    /// Returns a line for each constant: the value that was found, and the configured one.
    pub fn constants(&self) -> impl Iterator<Item = String> {
        self.constants.iter().map(Constant::to_string)
    }

    /// Returns `calibration.toml`: the constants that contradict the configured ones, and why the
    /// others stay as configured.
    pub fn toml(&self) -> String {
        let mut text = format!(
            "# Found by gyre calibrate from {} scans, {:.0} m.\n\n[dataset]\n",
            self.scans, self.path_m
        );
        for constant in self.constants.iter().chain(&self.resolution) {
            let (found, configured) = (constant.found, constant.configured);
            let digits = (1.0 - found.sigma.log10().floor()).clamp(1.0, 9.0) as usize;
            let (key, verdict) = (constant.label.0, constant.verdict);
            let _ = match verdict {
                Verdict::Contradicts => writeln!(
                    text,
                    "{key} = {:.digits$} # \u{b1} {:.digits$}, configured {configured:.digits$}",
                    found.value, found.sigma
                ),
                _ => writeln!(
                    text,
                    "# {key} stays {configured:.digits$}: {found:.digits$} {verdict}"
                ),
            };
        }
        text
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Undetermined => "is too uncertain to be used",
            Self::Agrees => "agrees with the configured value",
            Self::Contradicts => "CONTRADICTS the configured value",
            Self::Worse => "makes the parts of the scans differ more",
        })
    }
}

fn reflections(own: &OwnReflections, configured_m: f64) -> String {
    match own.end_m() {
        None => "too few moving scans to find them".to_owned(),
        Some(0.0) => "nothing stays in place in nine of ten moving scans".to_owned(),
        Some(end_m) if end_m >= OwnReflections::REACH_M => format!(
            "power everywhere within {end_m:.0} m in nine of ten moving scans: raise masking.threshold to find them"
        ),
        Some(end_m) => format!(
            "to {end_m:.2} m in nine of ten moving scans; points.min_range_m = {configured_m}"
        ),
    }
}

impl fmt::Display for Constant {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (_, name, unit, scale) = self.label;
        let (found, verdict) = (self.found.times(scale), self.verdict);
        let configured = self.configured * scale;
        write!(
            f,
            "{name:<21} {found} {unit}, configured {configured:.4}: {verdict}"
        )?;
        let is_unlike = self.found.contradicts(self.configured);
        match verdict == Verdict::Undetermined && is_unlike {
            true => f.write_str(", but contradicts the configured value"),
            false => Ok(()),
        }
    }
}

impl fmt::Display for Found {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let (scans, path_m, pairs) = (self.scans, self.path_m, self.pairs);
        write!(f, "{scans} scans, {path_m:.0} m, {pairs} pairs of scans")?;
        if !self.has_settled {
            write!(
                f,
                "\nthe constants have not settled: take a longer drive, or begin with constants that are nearer"
            )?;
        }
        for constant in self.constants.iter().chain(&self.resolution) {
            write!(f, "\n{constant}")?;
        }
        for (name, note) in &self.notes {
            write!(f, "\n{name:<21} {note}")?;
        }
        self.differences.map_or(Ok(()), |[before, after]| {
            write!(
                f,
                "\n{:<21} differ by {before:.3} as configured, by {after:.3} with what contradicts it (mean squares over the usual one)",
                "parts of the scans"
            )
        })
    }
}
