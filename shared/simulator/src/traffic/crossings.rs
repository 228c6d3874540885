//! Who waits in side streets while the driven vehicle passes, and crosses when it has gone.

use gyre_geometry::Pose;
use nalgebra::{Point2, Vector2};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::actor::Actor;
use super::crowd::Crowd;
use super::own_way::OwnWay;
use super::road_user::Kind;
use super::track::{Crossing, Track};
use crate::lanes::{DrivingSide, LANE_M};
use crate::path::spline::{Sample, UniformSpline};
use crate::streets::{Street, Streets};

/// Vehicles are shown while the driven one is so near to the junction, metres.
const SEEN_M: f64 = 170.0;
/// And keep off the junction while it is so near, metres.
const KEEP_OFF_M: f64 = 40.0;
/// From a kerb to the nose of one who waits, metres; between two who wait.
const STOP_M: f64 = 1.5;
const BETWEEN_M: f64 = 2.5;
/// Longest queue.
const LONGEST: usize = 3;
/// Length of a side street that is driven, metres.
const PATH_M: f64 = 120.0;
/// Nobody comes out of a shorter street, metres.
const SHORTEST_M: f64 = 30.0;
/// How near to the junction's middle others must not be while somebody crosses, metres, and for how long, seconds.
const CLEAR_M: f64 = 9.0;
const CLEAR_S: f64 = 5.0;

/// A junction of side streets with the way.
struct Junction<'a> {
    place: Point2<f64>,
    /// From its middle to where the side streets begin, metres.
    kerb_m: f64,
    from: &'a Street,
    /// The side street across, if there is one.
    to: Option<&'a Street>,
}

/// Adds those who come out of side streets; `share` of the streets have any.
pub fn add(
    crowd: &mut Crowd,
    streets: &Streets,
    way: &OwnWay,
    keep: DrivingSide,
    share: f64,
    rng: &mut ChaCha8Rng,
) {
    for junction in junctions(streets) {
        for pass in passes(&junction, way) {
            if rng.random_bool(share) {
                queue(crowd, &junction, way, pass, keep, rng);
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
    let way = ends[1] - ends[0];
    let share = ((place - ends[0]).dot(&way) / way.norm_squared().max(1e-9)).clamp(0.0, 1.0);
    (ends[0] + way * share - place).norm()
}

/// Direction in which a side street leaves its junction.
fn direction(street: &Street) -> Vector2<f64> {
    street.at(10.0).rotation * Vector2::x()
}

/// A time that the driven vehicle spends near a junction: when it is seen, and when it is close, seconds.
#[derive(Clone, Copy)]
struct Pass {
    seen_s: [f64; 2],
    close_s: [f64; 2],
}

fn passes(junction: &Junction<'_>, way: &OwnWay) -> Vec<Pass> {
    let mut passes: Vec<Pass> = Vec::new();
    let mut open: Option<Pass> = None;
    for step in 0..=(2.0 * way.duration_s()) as usize {
        let time_s = 0.5 * step as f64;
        let own = way.pose(way.progress_m(time_s), 0.0).translation.vector;
        let distance_m = (own - junction.place.coords).norm();
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

/// A queue that is there when the vehicle passes; what it waits for once the vehicle has gone is a gap in the traffic.
fn queue(
    crowd: &mut Crowd,
    junction: &Junction<'_>,
    way: &OwnWay,
    pass: Pass,
    keep: DrivingSide,
    rng: &mut ChaCha8Rng,
) {
    let (path, length_m, nose_m) = path(junction, keep);
    let mut stop_m = nose_m;
    let mut from_s = pass.close_s[0] - rng.random_range(-2.0..12.0);
    let mut until_s = pass.close_s[1] + rng.random_range(0.5..3.0);
    for _ in 0..rng.random_range(1..=LONGEST) {
        let kind = Kind::motorised(rng);
        let (half_m, _) = kind.half_m();
        if stop_m < 2.0 * half_m + 5.0 {
            break;
        }
        until_s = match junction.to {
            Some(_) => gap(crowd, junction.place, way, until_s, pass.seen_s[1]),
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
        crowd.add(kind, pass.seen_s, track, rng);
        stop_m -= 2.0 * half_m + BETWEEN_M;
        from_s += 2.5;
        until_s += 2.5;
    }
}

/// The first time from `from_s` on at which nobody else is on the junction; never if there is none before `until_s`.
fn gap(crowd: &Crowd, place: Point2<f64>, way: &OwnWay, from_s: f64, until_s: f64) -> f64 {
    let there = |actor: &Actor, time_s: f64| {
        let on_way = !matches!(actor.track, Track::Crossing(_)) && actor.is_shown(time_s);
        let pose = if on_way {
            actor.track.pose(way, time_s)
        } else {
            None
        };
        pose.is_some_and(|pose| (pose.translation.vector - place.coords).norm() < CLEAR_M)
    };
    let mut start_s = from_s;
    let mut time_s = from_s;
    while time_s < (start_s + CLEAR_S).min(until_s) {
        if crowd.actors.iter().any(|actor| there(actor, time_s)) {
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

/// The path out of a side street, in its lane, and into the one across; its length; and where the nose of the first stands.
fn path(junction: &Junction<'_>, keep: DrivingSide) -> (UniformSpline<2>, f64, f64) {
    let side = if keep == DrivingSide::Left { 1.0 } else { -1.0 };
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
