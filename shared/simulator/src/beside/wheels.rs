use gyre_geometry::{Pose, Twist};
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use super::{Device, Measure, normal, rounded};
use crate::{
    path::Path,
    stream::{Episodes, Stream},
};

/// Time between slips and their duration, s; share of the samples that are lost.
const FAULTS: [f64; 3] = [4.0, 0.5, 0.02];

/// The speed of the wheels of the axle that does not steer, below the radar.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SimulatedWheelsConfig {
    /// Samples a second. Default: 0, no wheels, and then the other keys have no effect.
    pub rate_hz: f64,
    /// Delay of the stamps against the radar's clock, seconds.
    pub delay_s: f64,
    /// True if the wheels turn 30 % too fast for 0.5 s in each 4 s and 2 % of the samples are lost.
    pub faults: bool,
}

/// The errors of wheels.
#[derive(Clone, Copy, Debug)]
pub struct WheelFigures {
    /// Standard deviation of the scale, a share.
    pub scale_sigma: f64,
    /// Noise of the distance, m/√m: tyres creep, and the road is not even.
    pub creep_m_per_sqrt_m: f64,
    /// Standard deviation of each sample, and its step, m/s.
    pub noise_mps: f64,
    pub step_mps: f64,
    /// Excess speed of wheels that slip, a share.
    pub slip_share: f64,
}

/// Tyres that are a percent off, and speeds in hundredths of a km/h.
const CAR: WheelFigures = WheelFigures {
    scale_sigma: 0.01,
    creep_m_per_sqrt_m: 0.01,
    noise_mps: 0.02,
    step_mps: 0.01 / 3.6,
    slip_share: 0.3,
};

pub(crate) fn device<'a>(
    wheels: &SimulatedWheelsConfig,
    seed: u64,
    path: &'a dyn Path,
) -> Option<Device<'a>> {
    let [every_s, lasts_s, lost] = if wheels.faults { FAULTS } else { [0.0; 3] };
    let mut errors = Stream::WHEEL_ERRORS.generator(seed);
    let measure = CAR.measure(&mut errors, |time_s| path.pose(time_s));
    let delay_s = wheels.delay_s;
    (wheels.rate_hz > 0.0).then(|| Device {
        rate_hz: wheels.rate_hz,
        stamped_at: 0.5,
        errors,
        host: None,
        clock: Box::new(move |_, time_s| time_s + delay_s),
        lost: Some(lost),
        episodes: Episodes::new(every_s, lasts_s, Stream::WHEEL_SLIPS.generator(seed)),
        stalls: false,
        measure,
    })
}

impl WheelFigures {
    /// Draws the scale of a drive, and returns what measures the mean speed of an axle, m/s, of
    /// wheels that slip in episodes.
    pub fn measure<'a>(self, rng: &mut ChaCha8Rng, axle: impl Fn(f64) -> Pose + 'a) -> Measure<'a> {
        let scale = 1.0 + self.scale_sigma * normal::<1>(rng).x;
        Box::new(move |rng, span_s, slips| {
            let [noise, creep]: [f64; 2] = normal::<2>(rng).into();
            let [before, after] = span_s.map(&axle);
            let duration_s = span_s[1] - span_s[0];
            let driven_mps = Twist::from_motion(&before.inv_mul(&after), duration_s).vx_mps;
            let creep_m = self.creep_m_per_sqrt_m * (driven_mps.abs() * duration_s).sqrt() * creep;
            let rolled_mps = driven_mps + creep_m / duration_s;
            let slip = if slips { self.slip_share } else { 0.0 };
            let turned = scale * rolled_mps * (1.0 + slip) + self.noise_mps * noise;
            let speed_mps = rounded(turned, self.step_mps);
            Some([speed_mps, 0.0, 0.0, 0.0, 0.0, 0.0])
        })
    }
}
