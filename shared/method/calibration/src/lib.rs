//! The constants of a radar, found from a drive alone, without ground truth.
//!
//! A wrong constant displaces the echoes of a scan by a smooth field, which moves with the vehicle.
//! So the left and the right half of the scans measure different turns, the front and the rear
//! different distances. [`calibrate`] finds the constants under which they measure the same.
//! [`calibrate_sensor`] finds the clocks of the other sensors by the track of the radar.

mod calibrate;
mod drive;
mod error;
mod facts;
mod findings;
mod own_reflections;
mod parts;
mod sensor;

pub use calibrate::{Calibration, calibrate};
pub use drive::{Drive, Reversal, Sweep, Track};
pub use error::CalibrationError;
pub use facts::{FACTS, Fact};
pub use findings::{Configured, Found, Study};
use own_reflections::OwnReflections;
pub use sensor::{
    ClockError, Compared, Kind, SensorCalibration, SensorSettings, calibrate_sensor, compare, kinds,
};

use std::fmt;

use nalgebra::SVector;

/// A configured value that is off by so many standard deviations is wrong.
const WRONG_SIGMAS: f64 = 3.0;

/// A number with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    pub value: f64,
    pub sigma: f64,
}

impl Estimate {
    pub(crate) const UNKNOWN: Self = Self::new(0.0, f64::INFINITY);

    pub(crate) const fn new(value: f64, sigma: f64) -> Self {
        Self { value, sigma }
    }

    /// Returns the estimate with an independent error added, of this standard deviation.
    pub(crate) fn with_error(self, sigma: f64) -> Self {
        Self::new(self.value, self.sigma.hypot(sigma))
    }

    pub(crate) fn times(self, factor: f64) -> Self {
        Self::new(self.value * factor, self.sigma * factor)
    }

    pub(crate) fn contradicts(&self, configured: f64) -> bool {
        (configured - self.value).abs() > WRONG_SIGMAS * self.sigma
    }

    pub(crate) fn verdict(&self, configured: Option<f64>) -> String {
        let Some(value) = configured else {
            return String::new();
        };
        match self.contradicts(value) {
            true => format!(", configured {value:.4}: CONTRADICTS the configured value"),
            false => format!(", configured {value:.4}: agrees with the configured value"),
        }
    }

    /// Returns the mean of two independent estimates, weighted by their information. If the
    /// difference exceeds their standard deviations, the standard deviation of the mean is larger
    /// accordingly.
    #[must_use]
    pub fn combined(&self, other: &Self) -> Self {
        let [own, others] = [self, other].map(|estimate| estimate.sigma.powi(-2));
        let apart = (self.value - other.value).abs() / self.sigma.hypot(other.sigma);
        Self {
            value: (own * self.value + others * other.value) / (own + others),
            sigma: (own + others).powf(-0.5) * apart.max(1.0),
        }
    }
}

/// Both with the digits that are asked for, or four.
impl fmt::Display for Estimate {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let digits = f.precision().unwrap_or(4);
        write!(f, "{:.digits$} \u{b1} {:.digits$}", self.value, self.sigma)
    }
}

pub(crate) const BLOCKS: usize = 12;

/// Estimates numbers, with their standard deviations by the jackknife: `solve` leaves out a block
/// of the drive.
pub(crate) fn jackknife<const N: usize>(
    solve: impl Fn(Option<usize>) -> Option<SVector<f64, N>>,
) -> Option<[Estimate; N]> {
    let all = solve(None)?;
    let mut variance = SVector::<f64, N>::zeros();
    for block in 0..BLOCKS {
        let apart = solve(Some(block))? - all;
        variance += apart.component_mul(&apart);
    }
    let share = (BLOCKS - 1) as f64 / BLOCKS as f64;
    let estimate = |k: usize| Estimate::new(all[k], (share * variance[k]).sqrt());
    Some(std::array::from_fn(estimate))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn estimates_that_contradict_each_other_give_a_wider_one() {
        let near = Estimate::new(1.0, 0.1);
        let agreeing = near.combined(&Estimate::new(1.1, 0.1));
        assert!((agreeing.value - 1.05).abs() < 1e-9 && agreeing.sigma < 0.08);
        let contradicting = near.combined(&Estimate::new(2.0, 0.1));
        assert!((contradicting.value - 1.5).abs() < 1e-9 && contradicting.sigma > 0.4);
    }
}
