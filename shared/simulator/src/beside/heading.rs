use gyre_geometry::wrap_angle;
use serde::{Deserialize, Serialize};

use super::{Device, normal};
use crate::{
    path::Path,
    stream::{Episodes, Stream},
};

/// A receiver with two antennas, or a compass, in a world whose x axis points to the east.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SimulatedHeadingConfig {
    /// Headings a second. Default: 0, no receiver, and then the other keys have no effect.
    pub rate_hz: f64,
    /// Standard deviation of each heading, degrees.
    pub noise_deg: f64,
    /// Constant error of all headings, degrees counter-clockwise: how the antennas are mounted.
    pub offset_deg: f64,
    /// Delay of the stamps against the radar's clock, seconds.
    pub delay_s: f64,
}

impl Default for SimulatedHeadingConfig {
    fn default() -> Self {
        Self {
            rate_hz: 0.0,
            noise_deg: 0.5,
            offset_deg: 0.0,
            delay_s: 0.0,
        }
    }
}

pub(crate) fn device<'a>(
    config: &SimulatedHeadingConfig,
    seed: u64,
    path: &'a dyn Path,
) -> Option<Device<'a>> {
    let SimulatedHeadingConfig {
        rate_hz, delay_s, ..
    } = *config;
    let [noise_rad, offset_rad] = [config.noise_deg, config.offset_deg].map(f64::to_radians);
    // The fixes have different random numbers.
    let errors = Stream::GNSS_ERRORS.generator(!seed);
    (rate_hz > 0.0).then(|| Device {
        rate_hz,
        stamped_at: 0.0,
        errors,
        host: None,
        clock: Box::new(move |_, time_s| time_s + delay_s),
        lost: None,
        episodes: Episodes::new(0.0, 0.0, Stream::GNSS_HOLES.generator(!seed)),
        stalls: false,
        measure: Box::new(move |rng, [time_s, _], _| {
            let error_rad = offset_rad + noise_rad * normal::<1>(rng).x;
            let heading_rad = wrap_angle(path.pose(time_s).rotation.angle() + error_rad);
            Some([heading_rad, 0.0, 0.0, 0.0, 0.0, 0.0])
        }),
    })
}
