//! Configuration of GNSS, and its fixes.

use std::path::PathBuf;

use serde::{Deserialize, Serialize};
use thiserror::Error;

/// Configuration of GNSS: section `[gnss]`.
///
/// Fixes are constraints of the pose graph of `[slam]`, and of nothing else: odometry is the same
/// with and without them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GnssConfig {
    /// Whose fixes are used.
    pub kind: GnssKind,
    /// The log, for `kind = "log"`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Time by which the stamps of the fixes are late against the radar's, s: it is taken off them.
    pub late_s: f64,
    /// The antenna in the frame of the radar: x forward, y left, m.
    pub lever_m: [f64; 2],
    /// Standard deviation of a fix along east and along north, m, where the log has none.
    pub sigma_m: f64,
    /// Time over which the errors of fixes are dependent, s: fixes within it count as one.
    pub correlation_s: f64,
}

/// Whose fixes are used.
#[derive(
    Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, schemars::JsonSchema,
)]
#[serde(rename_all = "kebab-case")]
pub enum GnssKind {
    /// None.
    #[default]
    None,
    /// The log that lies beside the scans; without one it is an error.
    Auto,
    /// The log that `file` names.
    Log,
}

impl Default for GnssConfig {
    /// A receiver without corrections: 2.5 m circular error probable, which its data sheet says,
    /// are 2.1 m along each axis.
    fn default() -> Self {
        Self {
            kind: GnssKind::None,
            file: None,
            late_s: 0.0,
            lever_m: [0.0, 0.0],
            sigma_m: 2.0,
            correlation_s: 10.0,
        }
    }
}

impl GnssConfig {
    /// Returns whether fixes are used.
    pub fn is_used(&self) -> bool {
        self.kind != GnssKind::None
    }

    /// Checks every value.
    ///
    /// # Errors
    /// The first key that is out of its bounds.
    pub fn validate(&self) -> Result<(), GnssConfigError> {
        let [forward, left] = self.lever_m;
        let lever = "metres, at most 100";
        let bounds = [
            (
                "late_s",
                self.late_s,
                [-1e6, 1e6],
                "seconds, at most a million",
            ),
            ("lever_m", forward, [-100.0, 100.0], lever),
            ("lever_m", left, [-100.0, 100.0], lever),
            (
                "sigma_m",
                self.sigma_m,
                [1e-3, 1e3],
                "metres, 0.001 to 1000",
            ),
            (
                "correlation_s",
                self.correlation_s,
                [0.0, 1e4],
                "seconds, 0 to 10000",
            ),
        ];
        let outside = bounds
            .into_iter()
            .find(|(_, value, [least, most], _)| !(*least..=*most).contains(value));
        match outside {
            Some((key, value, _, expected)) => Err(GnssConfigError {
                key,
                value,
                expected,
            }),
            None => Ok(()),
        }
    }
}

/// A setting of `[gnss]` out of its bounds.
#[derive(Clone, Debug, PartialEq, Error)]
#[error("gnss.{key} is {value}, but must be {expected}")]
pub struct GnssConfigError {
    /// The key.
    pub key: &'static str,
    /// The value.
    pub value: f64,
    /// The values that it may have.
    pub expected: &'static str,
}

/// A fix of a GNSS receiver in a plane that touches the earth: where its antenna was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GnssFix {
    /// Time on the radar's clock, ns since 1970.
    pub stamp_ns: i64,
    /// Place, m east of the origin of the plane.
    pub east_m: f64,
    /// Place, m north.
    pub north_m: f64,
    /// Standard deviation along each of both axes, m.
    pub sigma_m: f64,
}
