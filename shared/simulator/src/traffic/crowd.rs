//! Who is on the road: the road users of a drive, drawn at random.

use std::f64::consts::TAU;

use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::actor::{Actor, OWN_HALF_M};
use super::config::TrafficConfig;
use super::own_way::OwnWay;
use super::road_user::Kind;
use super::track::{Beside, Gap, Lane, Oncoming, Track};
use crate::lanes::LANE_M;

/// Bodies of road users are numbered from here; the town has fewer.
pub const FIRST_BODY: u32 = 1 << 24;
/// Between vehicles that stand in a queue, metres.
const QUEUE_M: f64 = 2.5;
/// Least time between oncoming vehicles, seconds, and how early or late each may run.
const HEADWAY_S: f64 = 2.4;
const DRIFT_S: f64 = 0.4;
/// Length of the way in which one vehicle overtakes at a density of 20 vehicles a kilometre, metres.
const OVERTAKING_M: f64 = 1200.0;
/// Metres between bus stops with a bus.
const BUS_STOP_M: f64 = 700.0;
/// How many vehicles are followed in the own lane, ahead and behind, at most.
const MOST_IN_LANE: usize = 6;

/// Road users with numbers of their own.
#[derive(Debug, Default)]
pub struct Crowd {
    pub actors: Vec<Actor>,
}

impl Crowd {
    pub fn add(&mut self, kind: Kind, shown_s: [f64; 2], track: Track, rng: &mut ChaCha8Rng) {
        let body = kind.body(FIRST_BODY + self.actors.len() as u32, rng);
        self.actors.push(Actor {
            body,
            half_m: kind.half_m(),
            shown_s,
            track,
        });
    }

    /// Vehicles ahead and behind: each follows the next one, with gaps that grow and shrink along the way.
    pub fn own_lane(&mut self, config: &TrafficConfig, rng: &mut ChaCha8Rng) {
        let mean_m = 1000.0 / config.vehicles_per_km;
        let count = ((200.0 / mean_m).ceil() as usize).clamp(1, MOST_IN_LANE);
        for ahead in [true, false] {
            let mut gaps: Vec<Gap> = Vec::new();
            let mut next_half_m = OWN_HALF_M.0;
            for _ in 0..count {
                let kind = Kind::motorised(rng);
                let period_m = rng.random_range(350.0..1500.0);
                // At most so much faster or slower than the next one.
                let most_m = config.speed_spread * period_m / (0.5 * TAU);
                let least_m = next_half_m + kind.half_m().0 + QUEUE_M;
                let more_m = (2.0 * mean_m * rng.random_range(0.3..1.7)).min(most_m);
                gaps.push(Gap {
                    least_m,
                    more_m,
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

    pub fn overtaking(&mut self, config: &TrafficConfig, way: &OwnWay, rng: &mut ChaCha8Rng) {
        let mean_m = OVERTAKING_M * 20.0 / config.vehicles_per_km;
        for at_m in places(way, mean_m, rng) {
            let kind = if rng.random_bool(0.8) {
                Kind::Car
            } else {
                Kind::Van
            };
            let beside = Beside {
                at_m,
                at_s: 0.0,
                share: 1.0 + config.speed_spread.max(0.1) * rng.random_range(0.8..1.6),
                speed_mps: 0.0,
                lane: Lane::Inwards(LANE_M - 0.3),
            };
            self.along(kind, beside, way, rng);
        }
    }

    /// Those in the other lane, but for those who would meet somebody overtaking.
    pub fn oncoming(&mut self, config: &TrafficConfig, way: &OwnWay, rng: &mut ChaCha8Rng) {
        let whole_s = way.clock_s(f64::INFINITY);
        let mean_mps = (way.length_m() + 600.0) / whole_s;
        let mean_s = (1000.0 / config.vehicles_per_km / mean_mps).max(1.2 * HEADWAY_S);
        let overtaking: Vec<Track> = self
            .actors
            .iter()
            .map(|actor| actor.track.clone())
            .collect();
        let mut enters_s = -whole_s - 60.0;
        while enters_s < way.duration_s() + 60.0 {
            enters_s += HEADWAY_S - (mean_s - HEADWAY_S) * (1.0 - rng.random::<f64>()).ln();
            let kind = Kind::motorised(rng);
            // Longer vehicles keep longer headways.
            enters_s += (kind.half_m().0 - 2.0).max(0.0) / mean_mps;
            let vehicle = Oncoming {
                enters_s,
                drift_s: DRIFT_S * (config.speed_spread / 0.3).min(1.5) * rng.random::<f64>(),
                period_m: rng.random_range(80.0..300.0),
                phase: rng.random_range(0.0..TAU),
            };
            let track = Track::Oncoming(vehicle);
            let shown_s = meeting(&track, way);
            if shown_s[0] < shown_s[1]
                && !overtaking
                    .iter()
                    .any(|other| meets(&track, other, way, shown_s))
            {
                self.add(kind, shown_s, track, rng);
            }
        }
    }

    /// Buses that stand in lay-bys.
    pub fn bus_stops(&mut self, way: &OwnWay, rng: &mut ChaCha8Rng) {
        for at_m in places(way, BUS_STOP_M, rng) {
            let beyond_m = Kind::Bus.half_m().1 + 0.3;
            let lane = if rng.random_bool(0.5) {
                Lane::OwnKerb(beyond_m)
            } else {
                Lane::OtherKerb(beyond_m)
            };
            self.along(
                Kind::Bus,
                Beside {
                    at_m,
                    at_s: 0.0,
                    share: 0.0,
                    speed_mps: 0.0,
                    lane,
                },
                way,
                rng,
            );
        }
    }

    pub fn cyclists(&mut self, config: &TrafficConfig, way: &OwnWay, rng: &mut ChaCha8Rng) {
        for at_m in places(way, 1000.0 / config.cyclists_per_km.max(1e-3), rng) {
            let share = rng.random_range(0.35..0.6);
            let lane = Lane::OwnKerb(-0.5);
            self.along(
                Kind::Cyclist,
                Beside {
                    at_m,
                    at_s: 0.0,
                    share,
                    speed_mps: 0.0,
                    lane,
                },
                way,
                rng,
            );
        }
    }

    pub fn pedestrians(&mut self, config: &TrafficConfig, way: &OwnWay, rng: &mut ChaCha8Rng) {
        for at_m in places(way, 1000.0 / config.pedestrians_per_km.max(1e-3), rng) {
            let beyond_m = rng.random_range(0.6..1.8);
            let lane = if rng.random_bool(0.5) {
                Lane::OwnKerb(beyond_m)
            } else {
                Lane::OtherKerb(beyond_m)
            };
            let speed_mps =
                rng.random_range(0.9..1.7) * if rng.random_bool(0.5) { 1.0 } else { -1.0 };
            let beside = Beside {
                at_m,
                at_s: way.time_at(at_m),
                share: 0.0,
                speed_mps,
                lane,
            };
            self.along(Kind::Pedestrian, beside, way, rng);
        }
    }

    /// Adds somebody who is around while the vehicle is within reach of where it meets them.
    fn along(&mut self, kind: Kind, beside: Beside, way: &OwnWay, rng: &mut ChaCha8Rng) {
        let reach_m = way.reach_m() / (1.0 - beside.share).abs();
        let shown_s = [-1.0, 1.0].map(|sign| way.time_at(beside.at_m + sign * (reach_m + 1.0)));
        self.add(
            kind,
            [shown_s[0] - 1.0, shown_s[1] + 1.0],
            Track::Beside(beside),
            rng,
        );
    }
}

/// Places along the way with random distances of some mean, metres.
fn places(way: &OwnWay, mean_m: f64, rng: &mut ChaCha8Rng) -> Vec<f64> {
    let mut all = Vec::new();
    let mut at_m = mean_m * rng.random::<f64>();
    while at_m < way.length_m() {
        all.push(at_m);
        at_m += mean_m * rng.random_range(0.3..1.7);
    }
    all
}

/// When an oncoming vehicle is within reach: the distance to it falls all the time.
fn meeting(track: &Track, way: &OwnWay) -> [f64; 2] {
    let apart_m = |time_s: f64| track.along_m(way, time_s) - way.progress_m(time_s);
    [way.reach_m(), -way.reach_m()].map(|wanted_m| {
        let (mut low_s, mut high_s) = (0.0, way.duration_s());
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

/// Whether two tracks meet in the lane of oncoming traffic.
fn meets(oncoming: &Track, other: &Track, way: &OwnWay, shown_s: [f64; 2]) -> bool {
    let Track::Beside(_) = other else {
        return false;
    };
    let count = ((shown_s[1] - shown_s[0]) / 0.25) as usize;
    (0..=count)
        .map(|i| shown_s[0] + 0.25 * i as f64)
        .any(|time_s| {
            let overtaking_m = other.along_m(way, time_s);
            let near = (overtaking_m - way.progress_m(time_s)).abs() < way.reach_m();
            near && (oncoming.along_m(way, time_s) - overtaking_m).abs() < 14.0
        })
}
