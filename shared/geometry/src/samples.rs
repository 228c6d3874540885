//! Samples of other sensors than the radar.
//!
//! A [`Sample`] is one measurement with its stamp on the radar's clock. The source hands each scan
//! the samples whose *stamps* fall into its interval, so that a registration never depends on the
//! arrival time of a sample.
//!
//! Axes follow the vehicle by REP-103: x forward, y left, z up. Rates are in rad/s, stamps in ns
//! since 1970 on the radar's clock.

mod config;
mod doppler;
mod geodesy;
mod gnss;
mod gyro;
mod integral;
mod live;
mod sample;
mod wheels;
mod wheels_config;

pub use config::{GyroConfig, SensorConfig, SensorKind, UpAxis};
pub use doppler::{DopplerConfig, DopplerDisplacement, DopplerKind, DopplerVelocity};
pub use geodesy::{Geographic, LocalPlane};
pub use gnss::{GnssConfig, GnssFix};
pub use gyro::{Gyro, GyroTurn, with_yaw_rate};
pub use integral::interval_of;
pub use live::LiveSamples;
pub use sample::{Logged, MAX_RATE_RADPS, MAX_SAMPLES, MAX_SPEED_MPS, Sample, SampleKind};
pub use wheels::{WheelDistance, Wheels};
pub use wheels_config::WheelsConfig;
