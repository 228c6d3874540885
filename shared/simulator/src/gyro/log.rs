//! The samples of a drive as a log has them: `imu.csv`.

use std::fmt::Write as _;

use gyre_samples::{Sample, SampleKind};

use super::attitude::Vehicle;
use super::clock::Clock;
use super::errors::Errors;
use crate::simulator::Simulator;

/// The file beside the scans.
pub(crate) const FILE: &str = "imu.csv";
/// Its first row: that of the log of RADIATE.
const HEADER: &str =
    "stamp_ns,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2";

/// The samples of a drive, from its first azimuth to its last, by their stamps: rates and
/// accelerations in the gyro's own axes. `None` without a gyro.
pub(crate) fn samples(simulator: &Simulator) -> Option<Vec<Sample>> {
    let config = simulator.config();
    let figures = config.gyro.figures()?;
    let seed = config.gyro_seed();
    let vehicle = Vehicle::new(simulator);
    let mut errors = Errors::new(&figures, config.gyro.up, seed);
    let mut clock = Clock::new(&config.gyro, seed);
    let start_ns = simulator.time(0).epoch_us * 1000;
    let end_s = simulator.scans() as f64 * simulator.sampling().period_us as f64 * 1e-6;
    let sample = |index: usize| {
        let span_s = [index, index + 1].map(|index| index as f64 / figures.rate_hz);
        let values = errors.measure(&vehicle.mean_motion(span_s));
        let stamp_ns = clock.stamp_ns(0.5 * (span_s[0] + span_s[1]))?;
        Some(Sample {
            stamp_ns: start_ns + stamp_ns,
            kind: SampleKind::Gyro as u32,
            reserved: 0,
            values,
        })
    };
    let count = (end_s * figures.rate_hz).ceil() as usize;
    Some((0..count).filter_map(sample).collect())
}

/// The samples as CSV: the numbers read from it are those of the samples.
pub(crate) fn csv(samples: &[Sample]) -> Vec<u8> {
    let mut text = format!("{HEADER}\n");
    for sample in samples {
        let _ = write!(text, "{}", sample.stamp_ns);
        for value in sample.values {
            let _ = write!(text, ",{value}");
        }
        text.push('\n');
    }
    text.into_bytes()
}
