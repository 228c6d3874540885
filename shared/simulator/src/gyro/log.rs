//! The samples of a drive as a log has them: `imu.csv`.

use std::fmt::Write as _;

use gyre_geometry::samples::{Sample, SampleKind};

use super::{SimulatedGyroConfig, attitude::MeanMotion, clock::Clock, errors::Errors};
use crate::path::Path;

pub(crate) const FILE: &str = "imu.csv";
/// The first row of the file, as in the log of RADIATE.
const HEADER: &str =
    "stamp_ns,gyro_x_radps,gyro_y_radps,gyro_z_radps,accel_x_mps2,accel_y_mps2,accel_z_mps2";

/// The samples during a drive along a path, which starts at a time and lasts for a duration, by
/// their stamps: rates and accelerations in the gyro's own axes. `None` without a gyro.
pub(crate) fn samples(
    config: &SimulatedGyroConfig,
    seed: u64,
    path: &dyn Path,
    (start_ns, end_s): (i64, f64),
) -> Option<Vec<Sample>> {
    let figures = config.profile.figures()?;
    let mut errors = Errors::new(&figures, seed);
    let mut clock = Clock::new(config, seed);
    let sample = |index: usize| {
        let span_s = [index, index + 1].map(|index| index as f64 / figures.rate_hz);
        let values = errors.measure(&MeanMotion::along(path, span_s));
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

pub(crate) fn csv(samples: &[Sample]) -> String {
    let mut text = format!("{HEADER}\n");
    for sample in samples {
        let _ = write!(text, "{}", sample.stamp_ns);
        for value in sample.values {
            let _ = write!(text, ",{value}");
        }
        text.push('\n');
    }
    text
}
