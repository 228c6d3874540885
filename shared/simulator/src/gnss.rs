use std::fmt::Write as _;

use gyre_geometry::samples::{Geographic, LocalPlane, Sample};
use nalgebra::Vector2;
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;
use serde::{Deserialize, Serialize};

use crate::{
    path::Path,
    stream::{Episodes, Stream},
};

pub(crate) const FILE: &str = "gnss.csv";
const HEADER: &str = "stamp_ns,latitude_deg,longitude_deg,sigma_m";
/// Standard deviation of each fix along each axis, and of the error that lasts (orbits and
/// atmosphere), m: a receiver of a car without corrections.
const NOISE_M: f64 = 0.3;
const BIAS_M: f64 = 1.0;
/// Time after which a third of that error is left, s.
const BIAS_LASTS_S: f64 = 60.0;
/// Time between holes without a fix, and the duration of each, s.
const HOLE_EVERY_S: f64 = 40.0;
const HOLE_S: f64 = 15.0;
/// The origin of the world, whose x axis points to the east.
const ORIGIN: Geographic = Geographic {
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

/// The fixes during a drive along a path, which starts at a time and lasts for a duration, by their
/// stamps. `None` without a receiver.
pub(crate) fn fixes(
    config: &SimulatedGnssConfig,
    seed: u64,
    path: &dyn Path,
    (start_ns, end_s): (i64, f64),
) -> Option<Vec<Sample>> {
    (config.rate_hz > 0.0).then(|| {
        let plane = LocalPlane::new(ORIGIN, 0.0);
        let mut rng = Stream::GNSS_ERRORS.generator(seed);
        let mut holes = Episodes::new(HOLE_EVERY_S, HOLE_S, Stream::GNSS_HOLES.generator(seed));
        let kept = (-1.0 / (config.rate_hz * BIAS_LASTS_S)).exp();
        let fresh_m = BIAS_M * (1.0 - kept * kept).sqrt();
        let mut bias_m = normal(&mut rng) * BIAS_M;
        let count = (end_s * config.rate_hz).ceil() as usize;
        let fix = |index: usize| {
            let time_s = index as f64 / config.rate_hz;
            bias_m = bias_m * kept + normal(&mut rng) * fresh_m;
            let error_m = bias_m + normal(&mut rng) * NOISE_M;
            let is_hole = holes.begin_s(time_s).is_some() && config.faults;
            let antenna = path.pose(time_s).translation.vector + error_m;
            let place = plane.place([antenna.x, antenna.y]);
            (!is_hole).then(|| {
                let stamp_ns = start_ns + (time_s * 1e9).round() as i64;
                let at = [place.latitude_deg, place.longitude_deg];
                Sample::fix(stamp_ns, at, 0.0, NOISE_M.hypot(BIAS_M))
            })
        };
        (0..count).filter_map(fix).collect()
    })
}

pub(crate) fn csv(fixes: &[Sample]) -> String {
    let mut text = format!("{HEADER}\n");
    for fix in fixes {
        let (stamp_ns, [latitude_deg, longitude_deg, _, sigma_m, ..]) = (fix.stamp_ns, fix.values);
        let _ = writeln!(text, "{stamp_ns},{latitude_deg},{longitude_deg},{sigma_m}");
    }
    text
}

fn normal(rng: &mut ChaCha8Rng) -> Vector2<f64> {
    Vector2::from_fn(|_, _| rng.sample(StandardNormal))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{SimulationConfig, simulator::Simulator};

    fn fixes_of(simulator: &Simulator) -> Option<Vec<Sample>> {
        let (config, path) = (simulator.config(), simulator.path());
        fixes(&config.gnss, config.seed, path, simulator.span())
    }

    #[test]
    fn fixes_err_by_as_much_as_they_say_and_holes_have_none() {
        let simulated = |faults: bool| {
            let gnss = SimulatedGnssConfig {
                rate_hz: 5.0,
                faults,
            };
            let config = SimulationConfig {
                scans: Some(1600),
                gnss,
                ..SimulationConfig::default()
            };
            let simulator = Simulator::new(&config).expect("a drive");
            let fixes = fixes_of(&simulator).unwrap_or_default();
            (simulator, fixes)
        };
        let (simulator, fixes) = simulated(false);
        let plane = LocalPlane::new(ORIGIN, 0.0);
        let square_m2 = |fix: &Sample| {
            let time_s = (fix.stamp_ns - simulator.span().0) as f64 * 1e-9;
            let truth = simulator.path().pose(time_s).translation.vector;
            (Vector2::from(plane.east_north(fix.geographic())) - truth).norm_squared()
        };
        let mean_m2 = fixes.iter().map(square_m2).sum::<f64>() / fixes.len() as f64;
        let stated = 2.0 * fixes[0].values[3].powi(2);
        assert_eq!(fixes.len(), 2000);
        assert!((0.3..3.0).contains(&(mean_m2 / stated)), "{mean_m2}");
        let holes = simulated(true).1.len();
        assert!((1200..1300).contains(&holes), "{holes}");
        let without = Simulator::new(&SimulationConfig::default()).expect("a drive");
        assert_eq!(fixes_of(&without), None);
    }
}
