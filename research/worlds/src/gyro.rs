//! The gyro beside the radar: the section `[simulation.gyro]`, and what the gyro measures.

mod attitude;
pub mod config;
#[cfg(test)]
mod tests;

use gyre_geometry::samples::UpAxis;
use gyre_simulator::beside::{Device, Episodes, Measure};
use rand::Rng;
use rand_distr::StandardNormal;

pub(crate) use attitude::Vehicle;
pub use config::SimulatedGyroConfig;
pub use gyre_simulator::beside::gyro::{GyroFigures, GyroProfile, MeanMotion};

use crate::stream::Stream;

/// The gyro of a drive with its host. `None` without a gyro.
pub(crate) fn device<'a>(
    config: &'a SimulatedGyroConfig,
    seed: u64,
    vehicle: Vehicle<'a>,
) -> Option<Device<'a>> {
    let figures = config.figures()?;
    let mut errors = Stream::GyroErrors.generator(seed);
    let mut level: Measure<'a> =
        figures.measure(&mut errors, move |span_s| vehicle.mean_motion(span_s));
    let stalls = Stream::GyroStalls.generator(seed);
    Some(Device {
        rate_hz: figures.rate_hz,
        stamped_at: 0.5,
        errors,
        host: Some(Stream::GyroClock.generator(seed)),
        clock: Box::new(|rng, time_s| {
            let jitter_s = config.jitter_s * rng.sample::<f64, _>(StandardNormal);
            time_s * (1.0 + config.clock_ppm * 1e-6) + config.late_s + jitter_s
        }),
        lost: Some(config.lost),
        episodes: Episodes::new(config.stall_every_s, config.stall_s, stalls),
        stalls: true,
        measure: Box::new(move |rng, span_s, in_episode| {
            let [x, y, z, ahead, left, above] = level(rng, span_s, in_episode)?;
            let [rates, accelerations] =
                [[x, y, z], [ahead, left, above]].map(|vector| in_axes(config.up, vector));
            let [x, y, z] = rates;
            let [ahead, left, above] = accelerations;
            // Adding zero turns a negative one into a positive one.
            Some([x, y, z, ahead, left, above].map(|value| value + 0.0))
        }),
    })
}

/// The components along the axes of a gyro of which `up` points up, of a vector along forward, left
/// and up.
fn in_axes(up: UpAxis, [x, y, z]: [f64; 3]) -> [f64; 3] {
    match up {
        UpAxis::Z => [x, y, z],
        UpAxis::MinusZ => [x, -y, -z],
        UpAxis::X => [z, x, y],
        UpAxis::MinusX => [-z, y, x],
        UpAxis::Y => [y, z, x],
        UpAxis::MinusY => [x, -z, y],
    }
}
