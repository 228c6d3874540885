//! The route of the ego vehicle by distance, along which all other traffic is placed.

use gyre_geometry::Pose;
use nalgebra::{Point2, Vector2};

use crate::lanes::DrivingSide;
use crate::path::Path;
use crate::path::spline::{Sample, UniformSpline};
use crate::streets::Streets;

/// Straight extension of the route before its start and after its end, metres.
const BEYOND_M: f64 = 300.0;
/// Cut-off wavelength of the route, metres: other vehicles do not copy shorter deviations.
const WIGGLE_M: f64 = 14.0;
/// Scale on which widths and speeds change, metres.
const GRADUAL_M: f64 = 60.0;
/// Distance between samples of the route, metres.
const STEP_M: f64 = 2.0;
/// Time between samples of the progress, seconds.
const STEP_S: f64 = 0.1;
/// Minimum speed of the others where the ego vehicle waits or turns, metres a second.
const SLOWEST_MPS: f64 = 4.5;
/// Maximum distance along the route at which traffic is visible, metres.
const REACH_M: f64 = 260.0;
/// A place of the route is passed again where the route comes nearer than this, metres.
const AGAIN_M: f64 = 6.0;

/// The route of the ego vehicle, and the traffic's pace along it.
#[derive(Clone, Debug)]
pub struct EgoRoute {
    /// Places by distance along the route, metres.
    places: UniformSpline<2>,
    /// Distance along the route by time.
    progress: UniformSpline<1>,
    /// Distance to the kerbs on the ego vehicle's side and on the other, metres, by distance along
    /// the route.
    kerbs: UniformSpline<2>,
    /// Travel time of the others from the start of the route, seconds, by distance along it, and
    /// the inverse.
    clock: UniformSpline<1>,
    place_of_clock: UniformSpline<1>,
    /// The ego side is on the left (1) or right (-1).
    side: f64,
    length_m: f64,
    duration_s: f64,
    reach_m: f64,
}

impl EgoRoute {
    /// The route of the first `duration_s` of a drive through `streets`.
    pub fn new(
        path: &dyn Path,
        duration_s: f64,
        streets: &Streets,
        driving_side: DrivingSide,
    ) -> Self {
        let side = if driving_side == DrivingSide::Left {
            1.0
        } else {
            -1.0
        };
        let duration_s = path.duration_s().min(duration_s);
        let times = (0..=(duration_s / STEP_S) as usize).map(|i| i as f64 * STEP_S);
        let poses: Vec<_> = times.map(|time_s| (time_s, path.pose(time_s))).collect();
        let driven = distances(&poses);
        let length_m = driven[driven.len() - 1];
        let one = |at: f64, value: f64| Sample {
            at,
            value: [value],
            weight: 1.0,
        };
        let progress: Vec<_> = poses
            .iter()
            .zip(&driven)
            .map(|((time_s, _), m)| one(*time_s, *m))
            .collect();
        let places = UniformSpline::fit(&place_samples(&poses, &driven), STEP_M, 1.0 / WIGGLE_M);
        let kerbs = kerb_samples(&places, length_m, streets);
        let (clock, place_of_clock) = clocks(&poses, &driven, length_m);
        let mut route = Self {
            places,
            progress: UniformSpline::fit(&progress, 0.25, 1.0),
            kerbs: UniformSpline::fit(&kerbs, 10.0, 1.0 / GRADUAL_M),
            clock,
            place_of_clock,
            side,
            length_m,
            duration_s,
            reach_m: REACH_M,
        };
        route.reach_m = REACH_M.min(0.45 * route.shortest_loop_m());
        route
    }

    /// Distance along the route at a time, metres.
    pub fn progress_m(&self, time_s: f64) -> f64 {
        self.progress.value(time_s)[0]
    }

    /// The first time at which the ego vehicle is at a place, seconds.
    pub fn time_at(&self, along_m: f64) -> f64 {
        let steps = (self.duration_s / STEP_S) as usize;
        let (mut low, mut high) = (0, steps);
        while low < high {
            let middle = (low + high) / 2;
            if self.progress_m(middle as f64 * STEP_S) < along_m {
                low = middle + 1
            } else {
                high = middle
            }
        }
        low as f64 * STEP_S
    }

    /// Travel time of the others from the start of the route to a place, seconds.
    pub fn clock_s(&self, along_m: f64) -> f64 {
        self.clock.value(along_m)[0]
    }

    /// Distance that the others travel from the start of the route in a time, metres.
    pub fn place_m(&self, clock_s: f64) -> f64 {
        self.place_of_clock.value(clock_s)[0]
    }

    /// A pose on the route, `inwards_m` beside the ego vehicle's track (towards the centre of the
    /// street), x along it.
    pub fn pose(&self, along_m: f64, inwards_m: f64) -> Pose {
        let ([x, y], [dx, dy]) = (self.places.value(along_m), self.places.slope(along_m));
        let along = Vector2::new(dx, dy)
            .try_normalize(1e-9)
            .unwrap_or(Vector2::x());
        let inwards = Vector2::new(along.y, -along.x) * self.side;
        Pose::new(
            Vector2::new(x, y) + inwards * inwards_m,
            along.y.atan2(along.x),
        )
    }

    /// Distance from the ego vehicle's track to the kerbs on its own side and on the other, metres.
    pub fn kerbs_m(&self, along_m: f64) -> [f64; 2] {
        self.kerbs.value(along_m)
    }

    /// Length of the route, metres.
    pub fn length_m(&self) -> f64 {
        self.length_m
    }

    /// Duration of the drive, seconds.
    pub fn duration_s(&self) -> f64 {
        self.duration_s
    }

    /// Maximum distance along the route at which traffic is visible, metres: less than half of the
    /// shortest loop, so that nothing is in two places.
    pub fn reach_m(&self) -> f64 {
        self.reach_m
    }

    /// Length of the shortest loop of the route, metres: until it passes the same place in the same
    /// direction.
    fn shortest_loop_m(&self) -> f64 {
        let count = (self.length_m / STEP_M) as usize;
        let poses: Vec<_> = (0..=count)
            .map(|i| self.pose(i as f64 * STEP_M, 0.0))
            .collect();
        let window = (2.0 * REACH_M / 0.9 / STEP_M) as usize;
        let again = |i: usize, j: &usize| {
            let seen = poses[i].inverse() * poses[*j];
            seen.translation.vector.norm() < AGAIN_M && seen.rotation.cos_angle() > 0.7
        };
        let first = 2 * (AGAIN_M / STEP_M) as usize;
        let loops = (0..=count).filter_map(|i| {
            (i + first..=(i + window).min(count))
                .find(|j| again(i, j))
                .map(|j| j - i)
        });
        loops
            .min()
            .map_or(f64::INFINITY, |steps| steps as f64 * STEP_M)
    }
}

fn distances(poses: &[(f64, Pose)]) -> Vec<f64> {
    let mut driven = vec![0.0];
    for pair in poses.windows(2) {
        let step_m = (pair[1].1.translation.vector - pair[0].1.translation.vector).norm();
        driven.push(driven[driven.len() - 1] + step_m);
    }
    driven
}

/// Places every few metres, with straight extensions at both ends.
fn place_samples(poses: &[(f64, Pose)], driven: &[f64]) -> Vec<Sample<2>> {
    let sample = |at: f64, place: Point2<f64>| Sample {
        at,
        value: [place.x, place.y],
        weight: 1.0,
    };
    let steps = (BEYOND_M / STEP_M) as i64;
    let straight = |pose: &Pose, from_m: f64, step: i64| {
        let ahead_m = step as f64 * STEP_M;
        sample(from_m + ahead_m, pose * Point2::new(ahead_m, 0.0))
    };
    let (first, last) = (&poses[0].1, &poses[poses.len() - 1].1);
    let mut samples: Vec<_> = (-steps..0).map(|step| straight(first, 0.0, step)).collect();
    samples.push(straight(first, 0.0, 0));
    for ((_, pose), at) in poses.iter().zip(driven) {
        if at - samples[samples.len() - 1].at >= STEP_M / 2.0 {
            samples.push(sample(*at, Point2::from(pose.translation.vector)));
        }
    }
    samples.extend((1..=steps).map(|step| straight(last, driven[driven.len() - 1], step)));
    samples
}

fn kerb_samples(places: &UniformSpline<2>, length_m: f64, streets: &Streets) -> Vec<Sample<2>> {
    let sample = |step: usize| {
        let at = step as f64 * 4.0;
        let [x, y] = places.value(at);
        let nearest = streets.nearest(Point2::new(x, y), 10.0);
        let (half_m, offset_m) =
            nearest.map_or((4.0, 1.6), |n| (n.offset_m - n.clearance_m, n.offset_m));
        Sample {
            at,
            value: [half_m - offset_m, half_m + offset_m],
            weight: 1.0,
        }
    };
    (0..=(length_m / 4.0) as usize).map(sample).collect()
}

/// Travel time by distance and its inverse: about the ego vehicle's pace, but without its stops.
fn clocks(
    poses: &[(f64, Pose)],
    driven: &[f64],
    length_m: f64,
) -> (UniformSpline<1>, UniformSpline<1>) {
    let count = ((length_m + 2.0 * BEYOND_M) / STEP_M) as usize;
    let mut seconds = 0.0;
    let mut clock = Vec::with_capacity(count + 1);
    let mut next = 0;
    for step in 0..=count {
        let at = step as f64 * STEP_M - BEYOND_M;
        while next + 1 < driven.len() && driven[next + 1] < at {
            next += 1;
        }
        // The mean speed over two seconds around the place.
        let (a, b) = (next.saturating_sub(10), (next + 10).min(driven.len() - 1));
        let ego_mps = (driven[b] - driven[a]) / (poses[b].0 - poses[a].0).max(STEP_S);
        clock.push(Sample {
            at,
            value: [seconds],
            weight: 1.0,
        });
        seconds += STEP_M / ego_mps.max(SLOWEST_MPS);
    }
    let inverse: Vec<_> = clock
        .iter()
        .map(|s| Sample {
            at: s.value[0],
            value: [s.at],
            weight: 1.0,
        })
        .collect();
    (
        UniformSpline::fit(&clock, 4.0, 1.0 / GRADUAL_M),
        UniformSpline::fit(&inverse, 0.5, 0.15),
    )
}
