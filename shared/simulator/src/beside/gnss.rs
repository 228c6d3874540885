use gyre_geometry::samples::{Geographic, LocalPlane};
use serde::{Deserialize, Serialize};

use super::{Device, Drift, normal};
use crate::{
    path::Path,
    stream::{Episodes, Stream},
};

/// Standard deviation of each fix along each axis, and of the error that lasts (orbits and
/// atmosphere), m: a receiver of a car without corrections.
const NOISE_M: f64 = 0.3;
const BIAS_M: f64 = 1.0;
/// Time after which a third of that error is left, s.
const BIAS_LASTS_S: f64 = 60.0;
/// Time between holes without a fix, and the duration of each, s.
const HOLES_S: [f64; 2] = [40.0, 15.0];
/// The origin of the world, whose x axis points to the east.
pub(super) const ORIGIN: Geographic = Geographic {
    latitude_deg: 50.0,
    longitude_deg: 10.0,
};

/// A GNSS receiver whose antenna is at the radar.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SimulatedGnssConfig {
    /// Fixes a second. Default: 0, no receiver, and then the other key has no effect.
    pub rate_hz: f64,
    /// True if there is no fix for 15 s in each 40 s.
    pub faults: bool,
}

pub(crate) fn device<'a>(
    config: &SimulatedGnssConfig,
    seed: u64,
    path: &'a dyn Path,
) -> Option<Device<'a>> {
    let rate_hz = config.rate_hz;
    let [every_s, lasts_s] = if config.faults { HOLES_S } else { [0.0; 2] };
    let plane = LocalPlane::new(ORIGIN, 0.0);
    let mut errors = Stream::GNSS_ERRORS.generator(seed);
    let bias_m = normal(&mut errors) * BIAS_M;
    let mut bias_m = Drift::<2>::new(BIAS_M, BIAS_LASTS_S, rate_hz, bias_m);
    (rate_hz > 0.0).then(|| Device {
        rate_hz,
        stamped_at: 0.0,
        errors,
        host: None,
        clock: Box::new(|_, time_s| time_s),
        lost: None,
        episodes: Episodes::new(every_s, lasts_s, Stream::GNSS_HOLES.generator(seed)),
        stalls: false,
        measure: Box::new(move |rng, [time_s, _], is_hole| {
            bias_m.step(rng);
            let error_m = bias_m.value + normal(rng) * NOISE_M;
            let antenna = path.pose(time_s).translation.vector + error_m;
            let place = plane.place([antenna.x, antenna.y]);
            let (at, sigma_m) = (
                [place.latitude_deg, place.longitude_deg],
                NOISE_M.hypot(BIAS_M),
            );
            (!is_hole).then_some([at[0], at[1], 0.0, sigma_m, 0.0, 0.0])
        }),
    })
}
