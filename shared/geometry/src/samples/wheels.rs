use std::path::PathBuf;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    bounds::{DELAY, GAP, NOISE, SCALE, SHARE, SettingError, WAIT, check},
    check_bounds,
    samples::{
        Evidence, Sample, SensorKind, UpAxis,
        config::{on_clock, sensor_config},
        integral::{Integral, Integrator},
    },
};

/// Least standard deviation of the scale around 1: the settings may be for other tyres.
const TYRES: f64 = 0.02;
/// Standard deviation of a speed by the rounding to a step, m/s.
const NOISE_MPS: f64 = 0.02;

/// Configuration of the wheels' speed: section `[wheels]`.
///
/// The defaults suit a car whose speed comes from its own bus.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct WheelsConfig {
    /// Whose speed is used.
    pub kind: SensorKind,
    /// The log, for `kind = "log"`: a table as CSV whose first row names its columns.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// The topic of the speed in ROS 2, of the type `nav_msgs/msg/Odometry`, in a bag also
    /// `geometry_msgs/msg/TwistStamped`. Default: `/odom` of a live radar, none of a bag.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub topic: Option<String>,
    /// The address and port for receiving datagrams of live wheels: lines of a stamp (ns since
    /// 1970) and the speed (m/s), with a comma between.
    pub listen: String,
    /// Longest time for which a scan of a live radar waits for its samples, ms.
    pub max_wait_ms: f64,
    /// Delay of the stamps of the speed against the radar's, s: it is subtracted from them.
    pub delay_s: f64,
    /// Distance of the radar ahead of the axle that does not steer, m.
    pub radar_ahead_m: f64,
    /// Distance of one tick of a log that counts ticks, or the rounding step of an odometer, m.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub m_per_tick: Option<f64>,
    /// True speed over the measured one.
    pub scale: f64,
    /// Standard deviation of that scale: tyres wear and warm, and a tachometer may show too much.
    pub scale_sigma: f64,
    /// Noise of the distance and of the place across the path, m/√m.
    pub noise_m_per_sqrt_m: f64,
    /// Standard deviation of the time of a sample against the radar's clock, s.
    pub time_sigma_s: f64,
    /// Longest time between two samples over which the speed is interpolated, s.
    pub max_gap_s: f64,
}

impl Default for WheelsConfig {
    fn default() -> Self {
        Self {
            kind: SensorKind::None,
            file: None,
            topic: None,
            listen: "127.0.0.1:6322".to_owned(),
            max_wait_ms: 20.0,
            delay_s: 0.0,
            radar_ahead_m: 0.0,
            m_per_tick: None,
            scale: 1.0,
            scale_sigma: 0.02,
            noise_m_per_sqrt_m: 0.01,
            time_sigma_s: 0.01,
            max_gap_s: 0.25,
        }
    }
}

impl WheelsConfig {
    fn of_rolling(&self, integral: &Integral) -> f64 {
        self.noise_m_per_sqrt_m.powi(2) * integral.sum.abs()
    }
}

sensor_config! { WheelsConfig is Wheels on "/odom":
    fn scale(&self) -> (f64, f64) {
        (self.scale, 4.0 * self.scale_sigma.max(TYRES))
    }

    fn validate(&self) -> Result<(), SettingError> {
        check_bounds! { self, "wheels":
            delay_s in DELAY,
            max_wait_ms in WAIT,
            radar_ahead_m in ([-10.0, 10.0], "metres, -10 to 10"),
            scale in SCALE,
            scale_sigma in SHARE,
            noise_m_per_sqrt_m in NOISE,
            time_sigma_s in NOISE,
            max_gap_s in GAP,
        }
        let step_m = self.m_per_tick.unwrap_or(1.0);
        let bounds = ([1e-6, 10.0], "metres, 0.000001 to 10");
        check("wheels", "m_per_tick", step_m, bounds)
    }

    fn max_wait_ms(&self) -> f64 {
        self.max_wait_ms
    }

    fn max_gap_s(&self) -> f64 {
        self.max_gap_s
    }

    fn m_per_tick(&self) -> Option<f64> {
        self.m_per_tick
    }

    /// Returns the distance ahead along the vehicle's path.
    fn measure(&self, between: &Integrator) -> Option<Evidence> {
        let integral = between.integral?;
        Some(Evidence {
            samples: integral.samples,
            interval_s: integral.interval_s,
            value: [integral.sum, 0.0],
            covariance: [self.variance_of(&integral), 0.0, self.of_rolling(&integral)],
        })
    }

    fn variance_of(&self, integral: &Integral) -> f64 {
        // The rounding error of a speed is constant while the speed is constant.
        let by_speed = NOISE_MPS * integral.interval_s;
        let by_time = self.time_sigma_s * integral.change;
        // Both ends are anywhere within a tick.
        let by_ticks_m2 = self.m_per_tick.unwrap_or_default().powi(2) / 6.0;
        self.of_rolling(integral) + by_speed * by_speed + by_time * by_time + by_ticks_m2
    }

    /// Takes a sample over to the radar's clock: the delay is taken off its stamp, and the scale is
    /// applied.
    fn on_radar(&self, sample: &Sample, _: Option<UpAxis>) -> Sample {
        Sample::speed(on_clock(sample, self.delay_s), sample.values[0] * self.scale)
    }
}
