//! A GNSS receiver: the section `[simulation.gnss]`, and what the receiver measures.

use std::f64::consts::TAU;

use gyre_geometry::samples::{Geographic, LocalPlane};
use gyre_simulator::beside::{Device, Drift, Episodes, normal};
use nalgebra::{Point2, Vector2};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::{stream::Stream, TunnelConfig, error::SimulatorError, limits::require_within, path::Path};

/// Time between the places of the path by which its length is measured, seconds.
const STEP_S: f64 = 0.05;

/// A GNSS receiver beside the radar. In a tunnel it has no fix.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, schemars::JsonSchema)]
#[serde(default, deny_unknown_fields)]
pub struct SimulatedGnssConfig {
    /// Fixes a second. Default: 0, no receiver, and then the other keys have no effect.
    pub rate_hz: f64,
    /// The seed of its errors. Default: the seed of the simulation.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub seed: Option<u64>,
    /// Standard deviation of each fix along each axis, m.
    pub noise_m: f64,
    /// Standard deviation along each axis of the error that lasts, m: orbits and atmosphere.
    pub bias_m: f64,
    /// Time after which a third of that error is left, s.
    pub bias_lasts_s: f64,
    /// Time between reflections, s, one in each such time; 0 for none.
    pub reflection_every_s: f64,
    /// Duration of a reflection, s.
    pub reflection_s: f64,
    /// Distance by which a reflection moves the fixes, all in one direction, m.
    pub reflection_m: f64,
    /// Time between holes without a fix, s, one in each such time; 0 for none.
    pub hole_every_s: f64,
    /// Duration of a hole, s.
    pub hole_s: f64,
    /// Time by which stamps are late against the radar's, s.
    pub late_s: f64,
    /// Share of the fixes that are lost.
    pub lost: f64,
    /// The antenna in the frame of the radar: x forward, y left, m.
    pub lever_m: [f64; 2],
    /// Latitude and longitude of the origin of the town, whose x axis points to the east, degrees.
    pub origin_deg: [f64; 2],
}

impl Default for SimulatedGnssConfig {
    /// A receiver of a car without corrections.
    fn default() -> Self {
        Self {
            rate_hz: 0.0,
            seed: None,
            noise_m: 0.3,
            bias_m: 1.0,
            bias_lasts_s: 60.0,
            reflection_every_s: 0.0,
            reflection_s: 0.0,
            reflection_m: 15.0,
            hole_every_s: 0.0,
            hole_s: 0.0,
            late_s: 0.0,
            lost: 0.0,
            lever_m: [0.0, 0.0],
            origin_deg: [50.0, 10.0],
        }
    }
}

impl SimulatedGnssConfig {
    /// Returns whether all keys are as configurations leave them out.
    pub(crate) fn is_default(&self) -> bool {
        *self == Self::default()
    }

    /// Checks that all values can be simulated.
    ///
    /// # Errors
    /// [`SimulatorError::Config`] with the key of the first value that cannot.
    pub fn validate(&self) -> Result<(), SimulatorError> {
        let [latitude_deg, longitude_deg] = self.origin_deg;
        for (key, value, min, max) in [
            ("gnss.rate_hz", self.rate_hz, 0.0, 100.0),
            ("gnss.noise_m", self.noise_m, 0.0, 100.0),
            ("gnss.bias_m", self.bias_m, 0.0, 100.0),
            ("gnss.bias_lasts_s", self.bias_lasts_s, 0.1, 1e6),
            ("gnss.reflection_every_s", self.reflection_every_s, 0.0, 1e6),
            (
                "gnss.reflection_s",
                self.reflection_s,
                0.0,
                self.reflection_every_s,
            ),
            ("gnss.reflection_m", self.reflection_m, 0.0, 1e4),
            ("gnss.hole_every_s", self.hole_every_s, 0.0, 1e6),
            ("gnss.hole_s", self.hole_s, 0.0, self.hole_every_s),
            ("gnss.late_s", self.late_s, -1e6, 1e6),
            ("gnss.lost", self.lost, 0.0, 1.0),
            ("gnss.lever_m", self.lever_m[0], -20.0, 20.0),
            ("gnss.lever_m", self.lever_m[1], -20.0, 20.0),
            ("gnss.origin_deg", latitude_deg, -85.0, 85.0),
            ("gnss.origin_deg", longitude_deg, -180.0, 180.0),
        ] {
            require_within(key, value, min, max)?;
        }
        Ok(())
    }
}

/// The receiver of a drive through these tunnels. `None` without a receiver.
pub(crate) fn device<'a>(
    config: &'a SimulatedGnssConfig,
    tunnels: &'a [TunnelConfig],
    seed: u64,
    path: &'a dyn Path,
) -> Option<Device<'a>> {
    let [latitude_deg, longitude_deg] = config.origin_deg;
    let origin = Geographic {
        latitude_deg,
        longitude_deg,
    };
    let plane = LocalPlane::new(origin, 0.0);
    let mut errors = Stream::GnssErrors.generator(seed);
    let bias_m = normal(&mut errors) * config.bias_m;
    let mut bias_m = Drift::<2>::new(config.bias_m, config.bias_lasts_s, config.rate_hz, bias_m);
    let mut surroundings = Surroundings::new(config, seed, path);
    let holes = Stream::GnssHoles.generator(seed);
    (config.rate_hz > 0.0).then(|| Device {
        rate_hz: config.rate_hz,
        stamped_at: 0.0,
        errors,
        host: None,
        clock: Box::new(|_, time_s| time_s + config.late_s),
        lost: Some(config.lost),
        episodes: Episodes::new(config.hole_every_s, config.hole_s, holes),
        stalls: false,
        measure: Box::new(move |rng, [time_s, _], is_hole| {
            bias_m.step(rng);
            let noise_m = normal(rng) * config.noise_m;
            let error_m = bias_m.value + noise_m + surroundings.reflected(time_s);
            let driven_m = surroundings.driven_m(time_s);
            let is_inside = |tunnel: &TunnelConfig| {
                (tunnel.from_m..tunnel.from_m + tunnel.length_m).contains(&driven_m)
            };
            if is_hole || tunnels.iter().any(is_inside) {
                return None;
            }
            let antenna = path.pose(time_s) * Point2::from(config.lever_m) + error_m;
            let place = plane.place([antenna.x, antenna.y]);
            let sigma_m = config.noise_m.hypot(config.bias_m);
            Some([place.latitude_deg, place.longitude_deg, 0.0, sigma_m, 0.0, 0.0])
        }),
    })
}

/// Reflections, and the way that the radar has driven.
struct Surroundings<'a> {
    config: &'a SimulatedGnssConfig,
    path: &'a dyn Path,
    reflections: Episodes,
    directions: ChaCha8Rng,
    /// When the last reflection began, s, and where it moves the fixes to.
    reflection: (f64, Vector2<f64>),
    /// Time up to which the way is measured, s, and the way, m.
    way: (f64, f64),
}

impl<'a> Surroundings<'a> {
    fn new(config: &'a SimulatedGnssConfig, seed: u64, path: &'a dyn Path) -> Self {
        let reflections = Stream::GnssReflections.generator(seed);
        Self {
            config,
            path,
            reflections: Episodes::new(config.reflection_every_s, config.reflection_s, reflections),
            directions: Stream::GnssDirections.generator(seed),
            reflection: (f64::NEG_INFINITY, Vector2::zeros()),
            way: (0.0, 0.0),
        }
    }

    /// Where a reflection moves a fix, m.
    fn reflected(&mut self, time_s: f64) -> Vector2<f64> {
        let Some(begin_s) = self.reflections.begin_s(time_s) else {
            return Vector2::zeros();
        };
        if begin_s > self.reflection.0 {
            let (sin, cos) = (TAU * self.directions.random::<f64>()).sin_cos();
            self.reflection = (begin_s, Vector2::new(cos, sin) * self.config.reflection_m);
        }
        self.reflection.1
    }

    /// The way that the radar has driven at a time of the drive, s; times ascend.
    fn driven_m(&mut self, time_s: f64) -> f64 {
        let (mut at_s, mut driven_m) = self.way;
        while at_s < time_s {
            let next_s = (at_s + STEP_S).min(time_s);
            let [from, to] = [at_s, next_s].map(|s| self.path.pose(s).translation.vector);
            driven_m += (to - from).norm();
            at_s = next_s;
        }
        self.way = (at_s, driven_m);
        driven_m
    }
}

#[cfg(test)]
mod tests {
    use gyre_geometry::samples::{Sample, SampleKind};

    use super::*;
    use crate::{SimulationConfig, Simulator, drive::DriveKind};

    /// A drive of some seconds, its fixes, and the true places of the radar at their times, m.
    fn simulated(
        gnss: SimulatedGnssConfig,
        tunnels: Vec<TunnelConfig>,
    ) -> (Vec<Sample>, Vec<Vector2<f64>>) {
        let mut config = SimulationConfig {
            scans: Some(120),
            gnss,
            tunnels,
            ..SimulationConfig::default()
        };
        config.drive.kind = DriveKind::Town;
        config.drive.speed_mps = 8.0;
        config.drive.length_m = 300.0;
        let simulator = Simulator::new(&config).expect("a drive");
        let fixes = simulator.samples(SampleKind::Gnss).unwrap_or_default();
        let origin = Sample::fix(0, config.gnss.origin_deg, 0.0, 0.0);
        let plane = LocalPlane::new(origin.geographic(), 0.0);
        let errors = fixes.iter().map(|fix| {
            let time_s = (fix.stamp_ns - simulator.span().0) as f64 * 1e-9 - config.gnss.late_s;
            let antenna = simulator.path().pose(time_s) * Point2::from(config.gnss.lever_m);
            Vector2::from(plane.east_north(fix.geographic())) - antenna.coords
        });
        let errors = errors.collect();
        (fixes, errors)
    }

    fn exact() -> SimulatedGnssConfig {
        SimulatedGnssConfig {
            rate_hz: 10.0,
            noise_m: 0.0,
            bias_m: 0.0,
            late_s: 1.5,
            lever_m: [0.5, -1.0],
            ..SimulatedGnssConfig::default()
        }
    }

    #[test]
    fn without_a_rate_there_is_no_receiver_and_an_exact_one_is_at_its_antenna() {
        assert!(
            simulated(SimulatedGnssConfig::default(), Vec::new())
                .0
                .is_empty()
        );
        let (fixes, errors_m) = simulated(exact(), Vec::new());
        assert_eq!(fixes.len(), 300);
        assert!(errors_m.iter().all(|error_m| error_m.norm() < 1e-6));
    }

    #[test]
    fn errors_have_the_standard_deviation_that_is_said_and_last() {
        let gnss = SimulatedGnssConfig {
            rate_hz: 100.0,
            noise_m: 0.2,
            bias_m: 2.0,
            bias_lasts_s: 0.2,
            ..exact()
        };
        let (fixes, errors_m) = simulated(gnss, Vec::new());
        let mean = |of: &dyn Fn(usize) -> f64| {
            (0..errors_m.len() - 20).map(of).sum::<f64>() / (errors_m.len() - 20) as f64
        };
        let variance_m2 = mean(&|at| 0.5 * errors_m[at].norm_squared());
        let stated_m2 = fixes[0].values[3].powi(2);
        assert!(
            (0.7..1.4).contains(&(variance_m2 / stated_m2)),
            "{variance_m2}"
        );
        let later = mean(&|at| 0.5 * errors_m[at].dot(&errors_m[at + 20])) / variance_m2;
        assert!((later - (-1.0f64).exp()).abs() < 0.2, "{later}");
    }

    #[test]
    fn reflections_move_fixes_together_and_holes_and_tunnels_have_none() {
        let reflected = SimulatedGnssConfig {
            reflection_every_s: 10.0,
            reflection_s: 2.0,
            ..exact()
        };
        let (_, errors_m) = simulated(reflected, Vec::new());
        let moved: Vec<_> = errors_m.iter().filter(|it| it.norm() > 1.0).collect();
        assert!((55..=65).contains(&moved.len()), "{}", moved.len());
        assert!((moved[1] - moved[0]).norm() < 1e-6 && (moved[0].norm() - 15.0).abs() < 1e-6);
        assert!((moved[25] - moved[0]).norm() > 1e-3);
        let with_holes = SimulatedGnssConfig {
            hole_every_s: 10.0,
            hole_s: 3.0,
            ..exact()
        };
        let count = simulated(with_holes, Vec::new()).0.len();
        assert!((205..=215).contains(&count), "{count}");
        let tunnel = TunnelConfig {
            from_m: 40.0,
            length_m: 60.0,
        };
        let (fixes, _) = simulated(exact(), vec![tunnel]);
        let gaps_ns = fixes
            .windows(2)
            .map(|pair| pair[1].stamp_ns - pair[0].stamp_ns);
        let longest_s = gaps_ns.max().unwrap_or_default() as f64 * 1e-9;
        // 60 m at up to 8 m/s.
        assert!((7.0..20.0).contains(&longest_s), "{longest_s}");
    }
}
