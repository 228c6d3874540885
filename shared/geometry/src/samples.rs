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
mod evidence;
mod geodesy;
mod gnss;
mod heading;
mod integral;
mod live;
mod predictor;
mod sample;
mod wheels;
mod witness;

pub use config::{GyroConfig, SensorConfig, SensorConfigs, SensorKind, UpAxis};
pub use doppler::{DopplerConfig, DopplerKind};
pub use evidence::{AllEvidence, Evidence, SampledSensors};
pub use geodesy::{Geographic, LocalPlane};
pub use gnss::{GnssConfig, GnssFix};
pub use heading::HeadingConfig;
pub use integral::{Integrator, interval_of};
pub use live::LiveSamples;
pub use predictor::{LearntErrors, PredictionStart};
pub use sample::{Logged, MAX_RATE_RADPS, MAX_SAMPLES, MAX_SPEED_MPS, Sample};
pub use wheels::WheelsConfig;
pub use witness::{Measures, Row, SampleKind, Witness};
