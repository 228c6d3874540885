//! The road users of a drive, drawn at random.

use std::f64::consts::TAU;

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::actor::{Actor, EGO_HALF_M};
use super::config::TrafficConfig;
use super::ego_route::EgoRoute;
use super::kind::Kind;
use super::track::{Alongside, Gap, Lane, Oncoming, Track};
use crate::lanes::LANE_M;

/// The first body number of road users; the town has fewer bodies.
pub const FIRST_BODY: u32 = 1 << 24;
/// Distance between vehicles in a queue, metres.
const QUEUE_M: f64 = 2.5;
/// Minimum headway of oncoming vehicles, and their maximum deviation from it, seconds.
const HEADWAY_S: f64 = 2.4;
const DRIFT_S: f64 = 0.4;
/// Distance in which one vehicle overtakes at a density of 20 vehicles a kilometre, metres.
const OVERTAKING_M: f64 = 1200.0;
/// Distance between bus stops with a bus, metres.
const BUS_STOP_M: f64 = 700.0;
/// Maximum number of vehicles ahead and behind in the ego lane.
const MAX_IN_LANE: usize = 6;

/// The road users, in the order of their body numbers.
#[derive(Debug, Default)]
pub struct Actors {
    pub actors: Vec<Actor>,
}

impl Actors {
    pub fn add(&mut self, kind: Kind, visible_s: [f64; 2], track: Track, rng: &mut ChaCha8Rng) {
        let body = kind.body(FIRST_BODY + self.actors.len() as u32, rng);
        self.actors.push(Actor {
            kind,
            body,
            half_m: kind.half_m(),
            visible_s,
            track,
        });
    }

    /// Vehicles ahead and behind: each follows the next, with gaps that vary along the route.
    pub fn ego_lane(&mut self, config: &TrafficConfig, rng: &mut ChaCha8Rng) {
        let mean_m = 1000.0 / config.vehicles_per_km;
        let count = ((200.0 / mean_m).ceil() as usize).clamp(1, MAX_IN_LANE);
        for ahead in [true, false] {
            let mut gaps: Vec<Gap> = Vec::new();
            let mut next_half_m = EGO_HALF_M.0;
            for _ in 0..count {
                let kind = Kind::motor_vehicle(rng);
                let period_m = rng.random_range(350.0..1500.0);
                // Limits the difference to the speed of the next vehicle.
                let max_m = config.speed_spread * period_m / (0.5 * TAU);
                let min_m = next_half_m + kind.half_m().0 + QUEUE_M;
                let extra_m = (2.0 * mean_m * rng.random_range(0.3..1.7)).min(max_m);
                gaps.push(Gap {
                    min_m,
                    extra_m,
                    period_m,
                    phase: rng.random_range(0.0..TAU),
                });
                next_half_m = kind.half_m().0;
                self.add(
                    kind,
                    [f64::NEG_INFINITY, f64::INFINITY],
                    Track::Lane {
                        ahead,
                        gaps: gaps.clone(),
                    },
                    rng,
                );
            }
        }
    }

    pub fn overtaking(&mut self, config: &TrafficConfig, route: &EgoRoute, rng: &mut ChaCha8Rng) {
        let mean_m = OVERTAKING_M * 20.0 / config.vehicles_per_km;
        for at_m in places(route, mean_m, rng) {
            let kind = if rng.random_bool(0.8) {
                Kind::Car
            } else {
                Kind::Van
            };
            let alongside = Alongside {
                at_m,
                at_s: 0.0,
                share: 1.0 + config.speed_spread.max(0.1) * rng.random_range(0.8..1.6),
                speed_mps: 0.0,
                lane: Lane::Inwards(LANE_M - 0.3),
            };
            self.along(kind, alongside, route, rng);
        }
    }

    /// Vehicles in the oncoming lane, except those that would meet an overtaking one.
    pub fn oncoming(&mut self, config: &TrafficConfig, route: &EgoRoute, rng: &mut ChaCha8Rng) {
        let drive_s = route.clock_s(f64::INFINITY);
        let mean_mps = (route.length_m() + 600.0) / drive_s;
        let mean_s = (1000.0 / config.vehicles_per_km / mean_mps).max(1.2 * HEADWAY_S);
        let overtaking: Vec<Track> = self
            .actors
            .iter()
            .map(|actor| actor.track.clone())
            .collect();
        let mut enters_s = -drive_s - 60.0;
        while enters_s < route.duration_s() + 60.0 {
            enters_s += HEADWAY_S - (mean_s - HEADWAY_S) * (1.0 - rng.random::<f64>()).ln();
            let kind = Kind::motor_vehicle(rng);
            // Longer vehicles keep longer headways.
            enters_s += (kind.half_m().0 - 2.0).max(0.0) / mean_mps;
            let vehicle = Oncoming {
                enters_s,
                drift_s: DRIFT_S * (config.speed_spread / 0.3).min(1.5) * rng.random::<f64>(),
                period_m: rng.random_range(80.0..300.0),
                phase: rng.random_range(0.0..TAU),
            };
            let track = Track::Oncoming(vehicle);
            let visible_s = meeting(&track, route);
            if visible_s[0] < visible_s[1]
                && !overtaking
                    .iter()
                    .any(|other| meets(&track, other, route, visible_s))
            {
                self.add(kind, visible_s, track, rng);
            }
        }
    }

    /// Buses in lay-bys.
    pub fn bus_stops(&mut self, route: &EgoRoute, rng: &mut ChaCha8Rng) {
        for at_m in places(route, BUS_STOP_M, rng) {
            let beyond_m = Kind::Bus.half_m().1 + 0.3;
            let lane = if rng.random_bool(0.5) {
                Lane::EgoKerb(beyond_m)
            } else {
                Lane::OtherKerb(beyond_m)
            };
            self.along(
                Kind::Bus,
                Alongside {
                    at_m,
                    at_s: 0.0,
                    share: 0.0,
                    speed_mps: 0.0,
                    lane,
                },
                route,
                rng,
            );
        }
    }

    pub fn cyclists(&mut self, config: &TrafficConfig, route: &EgoRoute, rng: &mut ChaCha8Rng) {
        for at_m in places(route, 1000.0 / config.cyclists_per_km.max(1e-3), rng) {
            let share = rng.random_range(0.35..0.6);
            let lane = Lane::EgoKerb(-0.5);
            self.along(
                Kind::Cyclist,
                Alongside {
                    at_m,
                    at_s: 0.0,
                    share,
                    speed_mps: 0.0,
                    lane,
                },
                route,
                rng,
            );
        }
    }

    pub fn pedestrians(&mut self, config: &TrafficConfig, route: &EgoRoute, rng: &mut ChaCha8Rng) {
        for at_m in places(route, 1000.0 / config.pedestrians_per_km.max(1e-3), rng) {
            let beyond_m = rng.random_range(0.6..1.8);
            let lane = if rng.random_bool(0.5) {
                Lane::EgoKerb(beyond_m)
            } else {
                Lane::OtherKerb(beyond_m)
            };
            let speed_mps =
                rng.random_range(0.9..1.7) * if rng.random_bool(0.5) { 1.0 } else { -1.0 };
            let alongside = Alongside {
                at_m,
                at_s: route.time_at(at_m),
                share: 0.0,
                speed_mps,
                lane,
            };
            self.along(Kind::Pedestrian, alongside, route, rng);
        }
    }

    /// Adds a road user that is visible while the ego vehicle is within reach of their meeting
    /// place.
    fn along(&mut self, kind: Kind, alongside: Alongside, route: &EgoRoute, rng: &mut ChaCha8Rng) {
        let reach_m = route.reach_m() / (1.0 - alongside.share).abs();
        let visible_s =
            [-1.0, 1.0].map(|sign| route.time_at(alongside.at_m + sign * (reach_m + 1.0)));
        self.add(
            kind,
            [visible_s[0] - 1.0, visible_s[1] + 1.0],
            Track::Alongside(alongside),
            rng,
        );
    }
}

/// Places along the route at random distances with a given mean, metres.
fn places(route: &EgoRoute, mean_m: f64, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let mut all = Vec::new();
    let mut at_m = mean_m * rng.random::<f64>();
    while at_m < route.length_m() {
        all.push(at_m);
        at_m += mean_m * rng.random_range(0.3..1.7);
    }
    all
}

/// The times between which an oncoming vehicle is within reach; the distance to it always
/// decreases.
fn meeting(track: &Track, route: &EgoRoute) -> [f64; 2] {
    let apart_m = |time_s: f64| track.along_m(route, time_s) - route.progress_m(time_s);
    [route.reach_m(), -route.reach_m()].map(|wanted_m| {
        let (mut low_s, mut high_s) = (0.0, route.duration_s());
        while high_s - low_s > 0.25 {
            let middle_s = 0.5 * (low_s + high_s);
            if apart_m(middle_s) > wanted_m {
                low_s = middle_s
            } else {
                high_s = middle_s
            }
        }
        0.5 * (low_s + high_s)
    })
}

/// Returns whether two tracks meet in the oncoming lane.
fn meets(oncoming: &Track, other: &Track, route: &EgoRoute, visible_s: [f64; 2]) -> bool {
    let Track::Alongside(_) = other else {
        return false;
    };
    let count = ((visible_s[1] - visible_s[0]) / 0.25) as usize;
    (0..=count)
        .map(|i| visible_s[0] + 0.25 * i as f64)
        .any(|time_s| {
            let overtaking_m = other.along_m(route, time_s);
            let near = (overtaking_m - route.progress_m(time_s)).abs() < route.reach_m();
            near && (oncoming.along_m(route, time_s) - overtaking_m).abs() < 14.0
        })
}
