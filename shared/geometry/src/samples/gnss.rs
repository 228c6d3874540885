use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    bounds::{DELAY, SettingError, check},
    check_bounds,
    samples::Geographic,
};

/// Configuration of GNSS: section `[gnss]`.
///
/// Fixes are constraints of the pose graph of `[slam]`, and of nothing else: odometry is the same
/// with and without them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GnssConfig {
    /// Whose fixes are used.
    pub kind: GnssKind,
    /// The log, for `kind = "log"`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// The topic of the fixes, of the type `sensor_msgs/msg/NavSatFix`: in a bag of ROS 2, for
    /// `kind = "auto"` (default: the only one), or for `kind = "ros2"` (default: `/fix`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub topic: Option<String>,
    /// The address and port for receiving datagrams of a live receiver, for `kind = "udp"`: lines
    /// of a stamp (ns since 1970), latitude and longitude (degrees) and, if it is known, the
    /// standard deviation along each axis (m), with commas between. For `kind = "ros2"` those that
    /// the source passes on.
    pub listen: String,
    /// Delay of the stamps of the fixes against the radar's, s: it is subtracted from them.
    pub delay_s: f64,
    /// The antenna in the frame of the radar: x forward, y left, m.
    pub lever_m: [f64; 2],
    /// Standard deviation of a fix along east and along north, m, where the log has none.
    pub sigma_m: f64,
    /// Time over which the errors of fixes are dependent, s: fixes within it count as one.
    pub correlation_s: f64,
}

/// Whose fixes are used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum GnssKind {
    /// None.
    #[default]
    None,
    /// The fixes in a bag of ROS 2, else the log that lies beside the scans; without either it is
    /// an error.
    Auto,
    /// The log that `file` names.
    Log,
    /// Of a live radar: what arrives in datagrams at `listen`.
    Udp,
    /// Of a radar behind its driver in ROS 2: the messages on `topic`.
    Ros2,
}

impl Default for GnssConfig {
    /// A receiver without corrections: 2.5 m circular error probable, as in its data sheet, are 2.1
    /// m along each axis.
    fn default() -> Self {
        Self {
            kind: GnssKind::None,
            file: None,
            topic: None,
            listen: "127.0.0.1:6323".to_owned(),
            delay_s: 0.0,
            lever_m: [0.0, 0.0],
            sigma_m: 2.0,
            correlation_s: 10.0,
        }
    }
}

impl GnssConfig {
    pub fn is_used(&self) -> bool {
        self.kind != GnssKind::None
    }

    pub fn is_live(&self) -> bool {
        matches!(self.kind, GnssKind::Udp | GnssKind::Ros2)
    }

    pub fn validate(&self) -> Result<(), SettingError> {
        for metres in self.lever_m {
            check(
                "gnss",
                "lever_m",
                metres,
                ([-100.0, 100.0], "metres, at most 100"),
            )?;
        }
        check_bounds! { self, "gnss":
            delay_s in DELAY,
            sigma_m in ([1e-3, 1e3], "metres, 0.001 to 1000"),
            correlation_s in ([0.0, 1e4], "seconds, 0 to 10000"),
        }
        Ok(())
    }
}

/// A fix of a GNSS receiver in a plane that touches the earth: where its antenna was.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct GnssFix {
    /// Time on the radar's clock, ns since 1970.
    pub stamp_ns: i64,
    pub east_m: f64,
    pub north_m: f64,
    pub sigma_m: f64,
}

/// A fix as it was logged, even if it is invalid.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct RawFix {
    /// Time on the receiver's clock, ns since 1970.
    pub stamp_ns: i64,
    /// Latitude and longitude, degrees; or m east and north.
    pub at: [f64; 2],
    /// Altitude above the ellipsoid, m; 0 where the log has none.
    pub altitude_m: f64,
    /// Standard deviation along each of both axes, m; not above zero where the log has none.
    pub sigma_m: f64,
    /// The receiver does not state whether it had a fix.
    pub status_is_unknown: bool,
}

impl RawFix {
    pub fn geographic(&self) -> Geographic {
        Geographic {
            latitude_deg: self.at[0],
            longitude_deg: self.at[1],
        }
    }

    /// Returns the standard deviation along each of both axes with these variances along them, m²;
    /// 0 if one is unknown, which is negative or not a number.
    pub fn sigma_of(variances_m2: [f64; 2]) -> f64 {
        match variances_m2.iter().all(|variance| *variance >= 0.0) {
            true => (0.5 * (variances_m2[0] + variances_m2[1])).sqrt(),
            false => 0.0,
        }
    }
}

/// The fixes in a bag of ROS 2, in degrees.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct BagFixes {
    pub topic: String,
    pub fixes: Vec<RawFix>,
    pub without_fix: usize,
}
