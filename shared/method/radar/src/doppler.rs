//! The velocity of the radar from the Doppler shift of one scan, without another scan to match.
//!
//! The shift is proportional to the radar's speed towards the echoes of the bearing, and the speeds
//! of all bearings determine its velocity: approach = vx cos(bearing) + vy sin(bearing), after Le
//! Gentil et al., "DRO: Doppler-aware direct radar odometry" (2025). Moving objects do not fit this
//! form and lose their weight.

mod fit;
mod rows;
mod shifts;

#[cfg(test)]
mod tests;

use std::f32::consts::TAU;

use fit::Fit;
use gyre_geometry::{
    samples::Evidence,
    scan::{PolarScan, ScanError, flag},
};
use rows::Rows;
use shifts::Shifts;
use thiserror::Error;

/// The least Doppler coefficient, s: with a smaller one no speed of a vehicle shifts an echo by a
/// bin.
const MIN_DOPPLER_S: f32 = 1e-3;

#[derive(Clone, Debug, PartialEq, Error)]
pub enum NoDoppler {
    #[error(
        "the radar does not say which azimuths it measures with rising chirps and which with falling ones"
    )]
    UnknownChirps,
    #[error(
        "rising and falling chirps do not alternate from azimuth to azimuth: at {alternating} of {azimuths} azimuths they do"
    )]
    NotAlternating {
        /// Azimuths between two of the other chirp.
        alternating: usize,
        azimuths: usize,
    },
    #[error(
        "the Doppler coefficient of the radar is not known: set dataset.doppler_s, the metres by which a closing speed of 1 m/s shifts a range (about 0.05 for a RAS6)"
    )]
    NoCoefficient,
    #[error("{bearings} bearings have echoes that both chirps see, but {needed} are needed")]
    TooFewBearings { bearings: usize, needed: usize },
    #[error("{agreeing} of {bearings} bearings agree on a velocity, which is too few")]
    NoAgreement { agreeing: usize, bearings: usize },
    #[error(transparent)]
    Scan(#[from] ScanError),
}

/// Checks that the chirps of a scan alternate and that its Doppler coefficient is known, since both
/// are needed to determine the velocity.
pub fn check_chirps(scan: &PolarScan<'_>) -> Result<(), NoDoppler> {
    scan.check()?;
    let azimuths = scan.geometry.azimuths;
    let known = |flags: &u8| flags & flag::CHIRP_KNOWN != 0;
    if !scan.flags[..azimuths].iter().any(known) {
        return Err(NoDoppler::UnknownChirps);
    }
    let alternating = (0..azimuths).filter(|it| alternates_at(scan, *it)).count();
    if 2 * alternating < azimuths {
        return Err(NoDoppler::NotAlternating {
            alternating,
            azimuths,
        });
    }
    match scan.geometry.doppler_s.abs() < MIN_DOPPLER_S {
        true => Err(NoDoppler::NoCoefficient),
        false => Ok(()),
    }
}

/// Returns whether an azimuth lies between two of the other chirp, half-way between their bearings.
/// The first and the last azimuth of a sweep are neighbours in bearing, but not in time.
fn alternates_at(scan: &PolarScan<'_>, azimuth: usize) -> bool {
    if azimuth == 0 || azimuth + 1 >= scan.geometry.azimuths {
        return false;
    }
    let three = [azimuth - 1, azimuth, azimuth + 1];
    let chirp = |of: usize| {
        let needed = flag::MEASURED | flag::CHIRP_KNOWN;
        let flags = scan.flags[of];
        (flags & needed == needed).then_some(flags & flag::CHIRP_UP)
    };
    let [Some(before), Some(here), Some(after)] = three.map(chirp) else {
        return false;
    };
    let step = TAU / scan.geometry.azimuths as f32;
    let [first, middle, last] = three.map(|of| scan.azimuth_rad[of]);
    let [to, on] = [middle - first, last - middle].map(|turn| turn.rem_euclid(TAU));
    before != here && after != here && to.max(on) < 1.5 * step && (to - on).abs() < 0.5 * step
}

/// Estimates the velocity of the radar from one scan after the other, each for itself. The first
/// scan of a size allocates the memory.
#[derive(Debug, Default)]
pub struct DopplerEstimator {
    rows: Rows,
    shifts: Shifts,
    fit: Fit,
}

impl DopplerEstimator {
    /// Returns the velocity of the radar in the middle of the sweep, along its own axes, with the
    /// covariance from the scatter of the bearings.
    ///
    /// Echoes nearer than `min_range_m` are left out: they are of the vehicle itself.
    pub fn estimate(
        &mut self,
        scan: &PolarScan<'_>,
        min_range_m: f32,
    ) -> Result<Evidence, NoDoppler> {
        check_chirps(scan)?;
        self.rows.update(scan, min_range_m);
        self.shifts.update(scan, &self.rows);
        self.fit.velocity(&self.shifts.rows)
    }
}
