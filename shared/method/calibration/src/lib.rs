//! The constants of a radar, found from a drive alone, without ground truth.
//!
//! A wrong constant displaces the echoes of a scan by a smooth field, which moves with the vehicle.
//! So two scans of one place from different poses cannot coincide, whatever their relative pose:
//! the slope of their overlap by each constant, at the relative pose that is best for it, shows the
//! direction of the right one. Wrong constants also make the track drift, and a road that is driven
//! twice lies twice. Both are residuals of the constants, and [`calibrate`] solves them.
//!
//! Reading order:
//! - [`Fact`]: the constants, and the fields of displacements;
//! - [`Drive`]: the scans as points; [`Track`]: the poses by odometry in both directions of time;
//! - `pair`, `image`: two scans with their relative pose and the slope of their overlap;
//! - `overlap`: all pairs of a drive, solved for the constants, with the jackknife over blocks of
//!   the drive;
//! - `revisits`, `drift`: places that are seen again, and the conclusions from the drift between
//!   them about the eccentricity;
//! - [`calibrate`]: the method;
//! - [`Mounting`], [`OwnReflections`]: what follows from the track and from the scans directly;
//! - [`Found`]: the constants beside the configured ones, with what each rests on; [`toml()`]: as a
//!   section of a configuration; [`svg`]: a place seen twice, before and after;
//! - [`calibrate_gyro`], [`calibrate_wheels`]: the clock and the axes of a gyro, the clock and the
//!   scale of the wheels, by the same track; [`delay()`]: the clock of either, by the motions of a
//!   run;
//! - [`Study`]: a drive with all these results, and the joint conclusion from several drives of one
//!   radar.

mod calibrate;
mod delay;
mod drift;
mod drive;
mod error;
mod facts;
mod findings;
mod gyro;
mod image;
mod mounting;
mod overlap;
mod own_reflections;
mod pair;
mod picture;
mod revisits;
mod section;
mod study;
mod wheels;

pub use calibrate::{Calibration, FactEstimate, calibrate};
pub use delay::{Compared, delay};
pub use drive::{Drive, Sweep, Track};
pub use error::CalibrationError;
pub use facts::{FACTS, Fact, FactMatrix, FactVector};
pub use findings::{Configured, Found};
pub use gyro::{GyroCalibration, GyroError, calibrate_gyro};
pub use mounting::Mounting;
pub use own_reflections::OwnReflections;
pub use picture::svg;
pub use revisits::Revisit;
pub use section::toml;
pub use study::Study;
pub use wheels::{WheelCalibration, WheelError, calibrate_wheels};

/// A number with its standard deviation.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Estimate {
    pub value: f64,
    /// The standard deviation.
    pub sigma: f64,
}

impl Estimate {
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn estimates_that_contradict_each_other_give_a_wider_one() {
        let near = Estimate {
            value: 1.0,
            sigma: 0.1,
        };
        let agreeing = near.combined(&Estimate {
            value: 1.1,
            sigma: 0.1,
        });
        assert!((agreeing.value - 1.05).abs() < 1e-9 && agreeing.sigma < 0.08);
        let contradicting = near.combined(&Estimate {
            value: 2.0,
            sigma: 0.1,
        });
        assert!((contradicting.value - 1.5).abs() < 1e-9 && contradicting.sigma > 0.4);
    }
}
