use std::path::{Path, PathBuf};

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{
    bounds::{DELAY, GAP, NOISE, SCALE, SHARE, SettingError, WAIT},
    check_bounds,
    samples::{
        DopplerConfig, Evidence, HeadingConfig, Sample, SampleKind, WheelsConfig, Witness,
        integral::{Integral, Integrator},
    },
};

/// Least standard deviation of a scale: an axis leans by up to 8 degrees, in bends and on slopes.
const LEANING: f64 = 0.01;

/// Noise of the turn about the vertical where the gyro's axis tilts with the vehicle, rad/√s. It is
/// the residual of the best bias and scale in the turns over 0.5 to 8 s on six simulated roads,
/// whose gradient is 2.6 % RMS along and across: 5.2e-4 RMS, 2e-4 to 1.1e-3 on single roads.
const TILT_RAD_PER_SQRT_S: f64 = 5e-4;

/// Configuration of the gyro: section `[gyro]`.
///
/// The noise is as in a data sheet. The defaults suit a gyro of a car.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct GyroConfig {
    /// Whose yaw rate is used.
    pub kind: SensorKind,
    /// The log, for `kind = "log"`: a table as CSV whose first row names its columns.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// The topic of the samples in ROS 2, of the type `sensor_msgs/msg/Imu`. Default: the only one
    /// of a bag; `/imu/data` of a live radar.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub topic: Option<String>,
    /// The address and port for receiving datagrams of a live gyro: lines of a stamp (ns since
    /// 1970) and the rates about x, y and z (rad/s), with commas between.
    pub listen: String,
    /// Longest time for which a scan of a live radar waits for its samples, ms.
    pub max_wait_ms: f64,
    /// Delay of the stamps of the gyro against the radar's, s: it is subtracted from them.
    pub delay_s: f64,
    /// The axis of the gyro that points up: `z`, `-z`, `x`, `-x`, `y` or `-y`. Default: the axis
    /// where the log measures gravity, or the axis of its format; else `z`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub up: Option<UpAxis>,
    /// True yaw rate over the measured one.
    pub scale: f64,
    /// Standard deviation of that scale.
    pub scale_sigma: f64,
    /// Bias at the start of a run, rad/s: it is subtracted from the measured rate.
    pub bias_radps: f64,
    /// Standard deviation of that bias, rad/s.
    pub bias_sigma_radps: f64,
    /// Angle random walk, rad/√s: one degree per square root of an hour is 2.9e-4.
    pub noise_rad_per_sqrt_s: f64,
    /// Random walk of the bias, rad/s/√s.
    pub bias_walk_radps_per_sqrt_s: f64,
    /// Standard deviation of the time of a sample against the radar's clock, s.
    pub time_sigma_s: f64,
    /// Longest time between two samples over which the rate is interpolated, s.
    pub max_gap_s: f64,
}

/// Whose samples of a sensor beside the radar are used.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "kebab-case")]
pub enum SensorKind {
    /// None: by the radar alone.
    #[default]
    None,
    /// The samples that come with the scans, else the log that lies beside them; without either it
    /// is an error.
    Auto,
    /// The log that `file` names.
    Log,
    /// Of a live radar: what arrives in datagrams at `listen`.
    Udp,
    /// Of a live radar behind its driver in ROS 2: the messages on `topic`.
    Ros2,
}

impl SensorKind {
    pub fn is_used(self) -> bool {
        self != Self::None
    }

    /// Returns whether the sensor is live: its samples arrive while the radar is received.
    pub fn is_live(self) -> bool {
        matches!(self, Self::Udp | Self::Ros2)
    }
}

/// The settings that all sensors beside the radar have.
pub trait SensorConfig {
    fn of(&self) -> SampleKind;

    fn kind(&self) -> SensorKind;

    /// The log, for [`SensorKind::Log`].
    fn file(&self) -> &Path;

    /// The topic that is configured; `None` also of a kind that no message of ROS 2 has.
    fn topic(&self) -> Option<&str> {
        None
    }

    /// The topic of a live sensor: the configured topic, or the usual one; `None` of a kind that no
    /// message of ROS 2 has.
    fn live_topic(&self) -> Option<&str> {
        None
    }

    /// The address for receiving datagrams.
    fn listen(&self) -> &str;

    /// Returns whether a run receives datagrams at that address.
    fn receives(&self) -> bool {
        self.kind() == SensorKind::Udp
    }

    /// Longest time for which a scan of a live radar waits for its samples, ms.
    fn max_wait_ms(&self) -> f64 {
        0.0
    }

    /// Delay of its stamps against the radar's, s.
    fn delay_s(&self) -> f64;

    /// The scale that is applied to the samples, and the farthest that their scale beyond it can be
    /// from 1.
    fn scale(&self) -> (f64, f64) {
        (1.0, f64::INFINITY)
    }

    /// Longest time between two samples over which a rate is interpolated, s.
    fn max_gap_s(&self) -> f64 {
        0.0
    }

    /// Distance of one tick of a log that counts ticks, m.
    fn m_per_tick(&self) -> Option<f64> {
        None
    }

    /// The axis that points up, if it is configured.
    fn up(&self) -> Option<UpAxis> {
        None
    }

    /// Returns the evidence about the motion from the scan before to a scan; `None` where samples
    /// are missing.
    fn measure(&self, _: &Integrator) -> Option<Evidence> {
        None
    }

    /// Returns the variance of an integral of the samples, but for the errors that all integrals
    /// share.
    fn variance_of(&self, _: &Integral) -> f64 {
        0.0
    }

    /// Takes a sample over to the radar's clock and the vehicle's axes. `up` is the axis that
    /// points up if the configuration names no axis.
    fn on_radar(&self, sample: &Sample, up: Option<UpAxis>) -> Sample;

    fn validate(&self) -> Result<(), SettingError>;

    fn boxed(&self) -> Box<dyn SensorConfig>;
}

/// The settings of all sensors beside the radar that measure motions: a section for each
/// [`Witness`].
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default)]
pub struct SensorConfigs {
    /// The gyro, if there is one.
    pub gyro: GyroConfig,
    /// The wheels, if their speed is known.
    pub wheels: WheelsConfig,
    /// The velocity by the Doppler shift of single scans.
    pub doppler: DopplerConfig,
    /// The heading itself, by two antennas or a compass.
    pub heading: HeadingConfig,
}

impl SensorConfigs {
    /// Returns the settings of a kind that comes as samples.
    pub fn of(&self, kind: Witness) -> Option<&dyn SensorConfig> {
        match kind {
            Witness::Gyro => Some(&self.gyro),
            Witness::Wheels => Some(&self.wheels),
            Witness::Doppler => None,
            Witness::Heading => Some(&self.heading),
        }
    }

    /// Returns the settings of the kinds that come as samples.
    pub fn sampled(&self) -> Vec<&dyn SensorConfig> {
        let kinds = Witness::ALL.into_iter();
        kinds.filter_map(|kind| self.of(kind)).collect()
    }

    pub fn is_used(&self, kind: Witness) -> bool {
        let sampled = self.of(kind).map(|it| it.kind().is_used());
        sampled.unwrap_or_else(|| self.doppler.is_used())
    }

    pub fn validate(&self) -> Result<(), SettingError> {
        self.sampled()
            .into_iter()
            .try_for_each(SensorConfig::validate)?;
        self.doppler.validate()
    }
}

/// The stamp of a sample on the radar's clock, ns, by the delay of the sensor's.
pub(super) fn on_clock(sample: &Sample, delay_s: f64) -> i64 {
    let late_ns = (delay_s * 1e9).round() as i64;
    sample.stamp_ns.saturating_sub(late_ns)
}

/// Makes a section with `kind`, `file` and `topic` the settings of a kind of sensor.
macro_rules! sensor_config {
    ($config:ident is $of:ident $(on $live_topic:literal)?: $($method:item)+) => {
        impl $config {
            pub fn is_used(&self) -> bool {
                self.kind.is_used()
            }

            pub fn is_live(&self) -> bool {
                self.kind.is_live()
            }
        }

        impl $crate::samples::SensorConfig for $config {
            fn of(&self) -> $crate::samples::SampleKind {
                $crate::samples::SampleKind::$of
            }

            fn kind(&self) -> SensorKind {
                self.kind
            }

            fn file(&self) -> &std::path::Path {
                self.file.as_deref().unwrap_or(std::path::Path::new(""))
            }

            $(
                fn topic(&self) -> Option<&str> {
                    self.topic.as_deref()
                }

                fn live_topic(&self) -> Option<&str> {
                    self.topic().or(Some($live_topic))
                }
            )?

            fn listen(&self) -> &str {
                &self.listen
            }

            fn delay_s(&self) -> f64 {
                self.delay_s
            }

            fn boxed(&self) -> Box<dyn $crate::samples::SensorConfig> {
                Box::new(self.clone())
            }

            $($method)+
        }
    };
}
pub(super) use sensor_config;

/// The axis of a gyro that points up.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum UpAxis {
    /// x points up.
    #[serde(rename = "x")]
    X,
    /// x points down.
    #[serde(rename = "-x")]
    MinusX,
    /// y points up.
    #[serde(rename = "y")]
    Y,
    /// y points down.
    #[serde(rename = "-y")]
    MinusY,
    /// z points up.
    #[default]
    #[serde(rename = "z")]
    Z,
    /// z points down.
    #[serde(rename = "-z")]
    MinusZ,
}

impl UpAxis {
    /// Returns a vector along the axes of the gyro in right-handed axes whose third points up. The
    /// axis that points ahead is unknown: z down implies x ahead and y right, z up implies x ahead
    /// and y left; other axes are named in their order.
    pub fn in_vehicle(self, [x, y, z]: [f64; 3]) -> [f64; 3] {
        match self {
            Self::Z => [x, y, z],
            Self::MinusZ => [x, -y, -z],
            Self::X => [y, z, x],
            Self::MinusX => [y, -z, -x],
            Self::Y => [z, x, y],
            Self::MinusY => [z, -x, -y],
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::X => "x",
            Self::MinusX => "-x",
            Self::Y => "y",
            Self::MinusY => "-y",
            Self::Z => "z",
            Self::MinusZ => "-z",
        }
    }
}

impl Default for GyroConfig {
    fn default() -> Self {
        Self {
            kind: SensorKind::None,
            file: None,
            topic: None,
            listen: "127.0.0.1:6321".to_owned(),
            max_wait_ms: 20.0,
            delay_s: 0.0,
            up: None,
            scale: 1.0,
            scale_sigma: 0.01,
            bias_radps: 0.0,
            bias_sigma_radps: 0.01,
            noise_rad_per_sqrt_s: 1e-4,
            bias_walk_radps_per_sqrt_s: 5e-6,
            time_sigma_s: 0.005,
            max_gap_s: 0.12,
        }
    }
}

impl GyroConfig {
    /// The farthest that a learnt scale of a gyro with these settings can be from 1.
    pub fn max_scale_error(&self) -> f64 {
        4.0 * self.scale_sigma.max(LEANING)
    }
}

sensor_config! { GyroConfig is Gyro on "/imu/data":
    fn scale(&self) -> (f64, f64) {
        (self.scale, self.max_scale_error())
    }

    fn validate(&self) -> Result<(), SettingError> {
        check_bounds! { self, "gyro":
            delay_s in DELAY,
            max_wait_ms in WAIT,
            scale in SCALE,
            scale_sigma in SHARE,
            bias_radps in ([-1.0, 1.0], "a rate in rad/s, at most 1"),
            bias_sigma_radps in ([0.0, 1.0], "a rate in rad/s, at most 1"),
            noise_rad_per_sqrt_s in NOISE,
            bias_walk_radps_per_sqrt_s in NOISE,
            time_sigma_s in ([0.0, 1.0], "seconds, 0 to 1"),
            max_gap_s in GAP,
        }
        Ok(())
    }

    fn max_wait_ms(&self) -> f64 {
        self.max_wait_ms
    }

    fn max_gap_s(&self) -> f64 {
        self.max_gap_s
    }

    fn up(&self) -> Option<UpAxis> {
        self.up
    }

    /// Returns the turn and the mean rate during the sweep, both with the bias.
    fn measure(&self, between: &Integrator) -> Option<Evidence> {
        let integral = between.integral?;
        let [_, sweep_rate_radps] = between.means();
        Some(Evidence {
            samples: integral.samples,
            interval_s: integral.interval_s,
            value: [integral.sum, sweep_rate_radps?],
            covariance: [self.variance_of(&integral), 0.0, 0.0],
        })
    }

    fn variance_of(&self, integral: &Integral) -> f64 {
        let of_rates = self.noise_rad_per_sqrt_s.powi(2) + TILT_RAD_PER_SQRT_S.powi(2);
        let by_time = self.time_sigma_s * integral.change;
        of_rates * integral.interval_s + by_time * by_time
    }

    /// Takes a sample over to the vehicle's axes and the radar's clock: the delay is taken off its
    /// stamp, the scale is applied to the yaw rate alone, and the bias to nothing.
    fn on_radar(&self, sample: &Sample, up: Option<UpAxis>) -> Sample {
        let [x, y, z, along_x, along_y, along_z] = sample.values;
        let up = self.up.or(up).unwrap_or_default();
        let [roll, pitch, yaw] = up.in_vehicle([x, y, z]);
        let [ahead, left, above] = up.in_vehicle([along_x, along_y, along_z]);
        Sample {
            stamp_ns: on_clock(sample, self.delay_s),
            values: [roll, pitch, yaw * self.scale, ahead, left, above],
            ..*sample
        }
    }
}
