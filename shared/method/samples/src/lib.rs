//! Samples of other sensors than the radar.
//!
//! A [`Sample`] is one measurement with its stamp on the radar's clock. The source hands each scan
//! the samples whose *stamps* fall into its interval, so that a registration never depends on the
//! arrival time of a sample.
//!
//! Reading order:
//! - [`Sample`]: one measurement, as it travels with a scan;
//! - [`GyroConfig`], [`WheelsConfig`]: the sections `[gyro]` and `[wheels]`;
//! - `integral`: the integral of a rate between two scans;
//! - [`Gyro`]: integrates the yaw rate between two scans, to a [`GyroTurn`];
//! - [`Wheels`]: integrates the speed, to a [`WheelDistance`];
//! - [`LiveSamples`]: the received samples of a live gyro or of live wheels;
//! - [`DopplerConfig`]: the section `[doppler]`, and [`DopplerVelocity`], which a scan determines
//!   itself;
//! - [`GnssConfig`]: the section `[gnss]`, and [`GnssFix`], which goes with no scan;
//! - [`LocalPlane`]: places on the earth as coordinates in a plane.
//!
//! Axes follow the vehicle by REP-103: x forward, y left, z up. Rates are in rad/s, stamps in ns
//! since 1970 on the radar's clock.

mod bounds;
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

pub use bounds::SampleConfigError;
pub use config::{GyroConfig, GyroKind, UpAxis};
pub use doppler::{DopplerConfig, DopplerDisplacement, DopplerKind, DopplerVelocity};
pub use geodesy::{Geographic, LocalPlane};
pub use gnss::{BagFixes, GnssConfig, GnssFix, GnssKind, RawFix};
pub use gyro::{Gyro, GyroTurn, with_yaw_rate};
pub use integral::interval_of;
pub use live::{LiveSamples, LiveSensor};
pub use sample::{MAX_RATE_RADPS, MAX_SAMPLES, MAX_SPEED_MPS, Sample, SampleKind};
pub use wheels::{WheelDistance, Wheels};
pub use wheels_config::{WheelsConfig, WheelsKind};
