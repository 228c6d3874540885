//! Vehicles that wait in side streets while the ego vehicle passes, and cross after it.

use gyre_geometry::Pose;
use nalgebra::{Point2, Vector2};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::actor::Actor;
use super::actors::Actors;
use super::ego_route::EgoRoute;
use super::kind::Kind;
use super::track::{Crossing, Track};
use crate::lanes::{DrivingSide, LANE_M};
use crate::path::spline::{Sample, UniformSpline};
use crate::streets::{Street, Streets};

/// Vehicles are visible while the ego vehicle is nearer to the junction than this, metres.
const SEEN_M: f64 = 170.0;
/// They wait while it is nearer than this, metres.
const KEEP_OFF_M: f64 = 40.0;
/// Distance from the kerb to the front of the first waiting vehicle, and between waiting vehicles,
/// metres.
const STOP_M: f64 = 1.5;
const BETWEEN_M: f64 = 2.5;
/// Maximum length of a queue.
const LONGEST: usize = 3;
/// Length of a side street that vehicles drive along, metres.
const PATH_M: f64 = 120.0;
/// Minimum length of a side street with vehicles, metres.
const SHORTEST_M: f64 = 30.0;
/// Others must not be nearer to the junction's centre than this, metres, during this time, seconds,
/// for a vehicle to cross.
const CLEAR_M: f64 = 9.0;
const CLEAR_S: f64 = 5.0;

/// A junction of side streets with the ego vehicle's route.
struct Junction<'a> {
    place: Point2<f64>,
    /// Distance from its centre to the side streets, metres.
    kerb_m: f64,
    from: &'a Street,
    /// The opposite side street, if there is one.
    to: Option<&'a Street>,
}

/// Adds the vehicles of side streets; `share` of the streets have some.
pub fn add(
    actors: &mut Actors,
    streets: &Streets,
    route: &EgoRoute,
    driving_side: DrivingSide,
    share: f64,
    rng: &mut ChaCha8Rng,
) {
    for junction in junctions(streets) {
        for pass in passes(&junction, route) {
            if rng.random_bool(share) {
                queue(actors, &junction, route, pass, driving_side, rng);
            }
        }
    }
}

fn junctions(streets: &Streets) -> impl Iterator<Item = Junction<'_>> {
    let sides = || {
        streets
            .streets()
            .iter()
            .filter(|street| !street.driven && street.length_m() > SHORTEST_M)
    };
    sides().map(move |from| {
        let place = from.centre[0];
        let nearest = streets.streets().iter().filter(|s| s.driven);
        let near = |s: &&Street| {
            s.centre
                .windows(2)
                .any(|ends| segment_distance_m(ends, place) < 1.0)
        };
        let kerb_m = nearest
            .filter(near)
            .map(|s| s.half_width_m)
            .fold(3.0, f64::max)
            .min(SHORTEST_M / 2.0);
        let across = |s: &&Street| {
            let opposite = direction(s).dot(&direction(from)) < -0.8;
            opposite && (s.centre[0] - place).norm() < 4.0
        };
        Junction {
            place,
            kerb_m,
            from,
            to: sides().find(across),
        }
    })
}

fn segment_distance_m(ends: &[Point2<f64>], place: Point2<f64>) -> f64 {
    let route = ends[1] - ends[0];
    let share = ((place - ends[0]).dot(&route) / route.norm_squared().max(1e-9)).clamp(0.0, 1.0);
    (ends[0] + route * share - place).norm()
}

/// The direction in which a side street leaves its junction.
fn direction(street: &Street) -> Vector2<f64> {
    street.at(10.0).rotation * Vector2::x()
}

/// A pass of the ego vehicle: the times during which it is within [`SEEN_M`] and within
/// [`KEEP_OFF_M`], seconds.
#[derive(Clone, Copy)]
struct Pass {
    seen_s: [f64; 2],
    close_s: [f64; 2],
}

fn passes(junction: &Junction<'_>, route: &EgoRoute) -> Vec<Pass> {
    let mut passes: Vec<Pass> = Vec::new();
    let mut open: Option<Pass> = None;
    for step in 0..=(2.0 * route.duration_s()) as usize {
        let time_s = 0.5 * step as f64;
        let ego = route.pose(route.progress_m(time_s), 0.0).translation.vector;
        let distance_m = (ego - junction.place.coords).norm();
        if distance_m > SEEN_M {
            passes.extend(open.take());
            continue;
        }
        let pass = open.get_or_insert(Pass {
            seen_s: [time_s; 2],
            close_s: [f64::INFINITY, f64::NEG_INFINITY],
        });
        pass.seen_s[1] = time_s;
        if distance_m < KEEP_OFF_M {
            pass.close_s = [pass.close_s[0].min(time_s), time_s];
        }
    }
    passes.extend(open);
    passes.retain(|pass| pass.close_s[0] <= pass.close_s[1]);
    passes
}

/// Adds a queue that waits while the ego vehicle passes, and then crosses in a gap of the traffic.
fn queue(
    actors: &mut Actors,
    junction: &Junction<'_>,
    route: &EgoRoute,
    pass: Pass,
    driving_side: DrivingSide,
    rng: &mut ChaCha8Rng,
) {
    let (path, length_m, nose_m) = path(junction, driving_side);
    let mut stop_m = nose_m;
    let mut from_s = pass.close_s[0] - rng.random_range(-2.0..12.0);
    let mut until_s = pass.close_s[1] + rng.random_range(0.5..3.0);
    for _ in 0..rng.random_range(1..=LONGEST) {
        let kind = Kind::motor_vehicle(rng);
        let (half_m, _) = kind.half_m();
        if stop_m < 2.0 * half_m + 5.0 {
            break;
        }
        until_s = match junction.to {
            Some(_) => gap(actors, junction.place, route, until_s, pass.seen_s[1]),
            None => f64::INFINITY,
        };
        let speed_mps = rng.random_range(7.0..10.0);
        let track = Track::Crossing(Crossing {
            path: path.clone(),
            waits_m: stop_m - half_m,
            from_s,
            until_s,
            speed_mps,
            length_m,
        });
        actors.add(kind, pass.seen_s, track, rng);
        stop_m -= 2.0 * half_m + BETWEEN_M;
        from_s += 2.5;
        until_s += 2.5;
    }
}

/// The first time from `from_s` on at which the junction is free; infinite if there is none before
/// `until_s`.
fn gap(actors: &Actors, place: Point2<f64>, route: &EgoRoute, from_s: f64, until_s: f64) -> f64 {
    let there = |actor: &Actor, time_s: f64| {
        let on_way = !matches!(actor.track, Track::Crossing(_)) && actor.is_visible(time_s);
        let pose = if on_way {
            actor.track.pose(route, time_s)
        } else {
            None
        };
        pose.is_some_and(|pose| (pose.translation.vector - place.coords).norm() < CLEAR_M)
    };
    let mut start_s = from_s;
    let mut time_s = from_s;
    while time_s < (start_s + CLEAR_S).min(until_s) {
        if actors.actors.iter().any(|actor| there(actor, time_s)) {
            start_s = time_s + 0.5;
        }
        time_s += 0.5;
    }
    if start_s + CLEAR_S < until_s {
        start_s
    } else {
        f64::INFINITY
    }
}

/// The path from a side street, in its lane, into the opposite one; its length; and the place of
/// the first vehicle's front.
fn path(junction: &Junction<'_>, driving_side: DrivingSide) -> (UniformSpline<2>, f64, f64) {
    let side = if driving_side == DrivingSide::Left {
        1.0
    } else {
        -1.0
    };
    let lane = |street: &Street, along_m: f64, outwards: f64| {
        let left_m = side * outwards * (LANE_M / 2.0).min(street.half_width_m / 2.0);
        (street.at(along_m) * Pose::translation(0.0, left_m))
            .translation
            .vector
    };
    let steps = |street: &Street| (street.length_m().min(PATH_M) / 2.0) as usize;
    let mouth = (junction.kerb_m / 2.0) as usize;
    let mut places: Vec<Vector2<f64>> = (mouth..=steps(junction.from))
        .rev()
        .map(|i| lane(junction.from, 2.0 * i as f64, -1.0))
        .collect();
    let nose_m = 2.0 * (places.len() - 1) as f64 - (junction.kerb_m - 2.0 * mouth as f64) - STOP_M;
    if let Some(to) = junction.to {
        places.extend((mouth + 1..=steps(to)).map(|i| lane(to, 2.0 * i as f64, 1.0)));
    }
    let mut at = 0.0;
    let mut before = places[0];
    let sample = |place: &Vector2<f64>| {
        at += (place - before).norm();
        before = *place;
        Sample {
            at,
            value: [place.x, place.y],
            weight: 1.0,
        }
    };
    let samples: Vec<_> = places.iter().map(sample).collect();
    (UniformSpline::fit(&samples, 2.0, 0.1), at, nose_m)
}
