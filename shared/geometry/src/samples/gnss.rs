use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    bounds::{DELAY, SettingError, check},
    check_bounds,
    samples::{
        Sample, SensorKind, UpAxis,
        config::{on_clock, sensor_config},
    },
};

/// Configuration of GNSS: section `[gnss]`.
///
/// Fixes are constraints of the pose graph of `[slam]`, and of nothing else: odometry is the same
/// with and without them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GnssConfig {
    /// Whose fixes are used.
    pub kind: SensorKind,
    /// The log, for `kind = "log"`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// The topic of the fixes, of the type `sensor_msgs/msg/NavSatFix`: in a bag of ROS 2, for
    /// `kind = "auto"` (default: the only one), or for `kind = "ros2"` (default: `/fix`).
    #[serde(skip_serializing_if = "Option::is_none")]
    pub topic: Option<String>,
    /// The address and port for receiving datagrams of a live receiver, for `kind = "udp"`: lines
    /// of a stamp (ns since 1970), latitude and longitude (degrees) and, if it is known, the
    /// standard deviation along each axis (m), with commas between.
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

impl Default for GnssConfig {
    /// A receiver without corrections: 2.5 m circular error probable, as in its data sheet, are 2.1
    /// m along each axis.
    fn default() -> Self {
        Self {
            kind: SensorKind::None,
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

sensor_config! { GnssConfig is Gnss on "/fix":
    fn validate(&self) -> Result<(), SettingError> {
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

    /// Takes a fix over to the radar's clock, with the configured uncertainty where the log has
    /// none.
    fn on_radar(&self, sample: &Sample, _: Option<UpAxis>) -> Sample {
        let sigma_m = sample.sigma_m().unwrap_or(self.sigma_m);
        Sample::fix(on_clock(sample, self.delay_s), sample.place(), sample.values[2], sigma_m)
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

impl From<Sample> for GnssFix {
    fn from(fix: Sample) -> Self {
        Self {
            stamp_ns: fix.stamp_ns,
            east_m: fix.values[0],
            north_m: fix.values[1],
            sigma_m: fix.values[3],
        }
    }
}
