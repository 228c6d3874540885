//! The velocity of the radar by the Doppler shift of one scan, and the displacement between two
//! scans by both velocities.

use std::f64::consts::PI;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    bounds::{SHARE, SettingError, check},
    samples::Evidence,
};

/// Least standard deviation of the scale around 1: `dataset.doppler_s` may be of another radar.
const OTHER_RADAR: f64 = 0.02;

/// Configuration of the velocity by Doppler: section `[doppler]`. Of radars whose rising and
/// falling chirps alternate from azimuth to azimuth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct DopplerConfig {
    /// Use of the velocity.
    pub kind: DopplerKind,
    /// Standard deviation of the true velocity over the measured one: how well `dataset.doppler_s`
    /// is known. The drive itself determines it better.
    pub scale_sigma: f64,
}

/// Use of the velocity by Doppler.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum DopplerKind {
    /// None: only the matches determine the motion.
    #[default]
    None,
    /// The velocity of each scan; with a radar whose chirps do not alternate, or without
    /// `dataset.doppler_s`, it is an error.
    Auto,
}

impl Default for DopplerConfig {
    fn default() -> Self {
        Self {
            kind: DopplerKind::None,
            scale_sigma: 0.03,
        }
    }
}

impl DopplerConfig {
    /// Standard deviation of an error of the velocity that lasts, beside the noise of each scan,
    /// m/s.
    pub const NOISE_MPS: f64 = 0.02;

    pub fn is_used(&self) -> bool {
        self.kind != DopplerKind::None
    }

    /// The farthest that a learnt scale with these settings can be from 1.
    pub fn max_scale_error(&self) -> f64 {
        4.0 * self.scale_sigma.max(OTHER_RADAR)
    }

    /// Returns the displacement ahead and to the left, m, along the heading in the middle, between
    /// two scans whose velocities are known: at the mean of both.
    ///
    /// Each velocity counts half in two displacements, so that the errors of these do not cancel
    /// and their variances are such that they add up. A velocity that changes evenly shifts a
    /// sweep's velocity to the side by 1 / (4 pi) of the change in a turn, and by as much along the
    /// path if the echoes are uneven: that is added.
    pub fn displacement(&self, [earlier, later]: [&Evidence; 2], interval_s: f64) -> Evidence {
        let mean = |of: fn(&Evidence) -> f64| 0.5 * (of(earlier) + of(later));
        let [ahead, left] = [mean(|it| it.value[0]), mean(|it| it.value[1])];
        let [dx, dy] = [0, 1].map(|axis| later.value[axis] - earlier.value[axis]);
        let by_change = (dx * dx + dy * dy) / (4.0 * PI).powi(2);
        let variance =
            |of_scans: f64| (of_scans + by_change + Self::NOISE_MPS.powi(2)) * interval_s.powi(2);
        let [of_ahead, of_left] = [mean(|it| it.covariance[0]), mean(|it| it.covariance[2])];
        Evidence {
            samples: later.samples,
            interval_s,
            value: [ahead * interval_s, left * interval_s],
            covariance: [variance(of_ahead), 0.0, variance(of_left)],
        }
    }

    pub fn validate(&self) -> Result<(), SettingError> {
        check("doppler", "scale_sigma", self.scale_sigma, SHARE)
    }
}

#[cfg(test)]
mod tests {
    use proptest::prelude::*;

    use super::*;

    fn velocity(value: [f64; 2], sigma: f64) -> Evidence {
        Evidence {
            samples: 100,
            interval_s: 0.0,
            value,
            covariance: [sigma * sigma, 0.0, 4.0 * sigma * sigma],
        }
    }

    proptest! {
        /// The displacement of a velocity that changes evenly is exact, and the sum of
        /// displacements whose velocities have independent errors has at most the sum of the stated
        /// variances.
        #[test]
        fn displacements_add_up_and_so_do_their_variances(
            start in -30.0..30.0f64, change in -1.0..1.0f64, sigma in 0.01..0.3f64, scans in 2usize..20,
        ) {
            let config = DopplerConfig::default();
            let at = |k: usize| velocity([start + change * k as f64, 0.1], sigma);
            let displacements: Vec<_> = (1..scans).map(|k| config.displacement([&at(k - 1), &at(k)], 0.25)).collect();
            let time_s = 0.25 * (scans - 1) as f64;
            let driven: f64 = displacements.iter().map(|it| it.value[0]).sum();
            let expected = time_s * (start + 0.5 * change * (scans - 1) as f64);
            prop_assert!((driven - expected).abs() < 1e-9);
            let left: f64 = displacements.iter().map(|it| it.value[1]).sum();
            prop_assert!((left - 0.1 * time_s).abs() < 1e-9);
            let said: f64 = displacements.iter().map(|it| it.covariance[0]).sum();
            // Errors of the ends count half, of those between whole.
            let of_errors = (sigma * 0.25).powi(2) * ((scans - 2) as f64 + 0.5);
            prop_assert!(said >= of_errors && displacements.iter().all(|it| it.covariance[2] > 0.0));
        }
    }

    #[test]
    fn values_out_of_bounds_are_named() {
        let wrong = |edit: fn(&mut DopplerConfig)| {
            let mut config = DopplerConfig::default();
            edit(&mut config);
            config.validate().map_err(|error| error.key).err()
        };
        assert_eq!(wrong(|_| ()), None);
        assert_eq!(wrong(|it| it.scale_sigma = f64::NAN), Some("scale_sigma"));
    }
}
