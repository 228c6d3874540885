use std::f64::consts::PI;

use gyre_geometry::Pose;
use nalgebra::Point2;

use crate::path::Path;

/// Distance between two nodes, metres.
pub(crate) const STEP_M: f64 = 1.0;
/// Time between two places of the path, seconds, when its length is measured.
const STEP_S: f64 = 0.02;
/// Distance from the vehicle to the kerbs on its left and on its right, metres: it keeps to the
/// left of a street with two lanes.
pub(crate) const KERBS_M: [f64; 2] = [2.8, 6.2];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Side {
    Left,
    Right,
}

impl Side {
    pub const BOTH: [Self; 2] = [Self::Left, Self::Right];
}

/// The way of the vehicle, one lap of it if the path repeats itself.
#[derive(Clone, Debug)]
pub(crate) struct Route {
    /// Places [`STEP_M`] apart, x along the way.
    pub nodes: Vec<Pose>,
    /// True if the path repeats itself.
    pub closed: bool,
}

impl Route {
    pub fn along(path: &dyn Path) -> Self {
        let closed = path.lap_s().is_some();
        let duration_s = path.lap_s().unwrap_or_else(|| path.duration_s());
        let place = |step: usize| {
            let at_s = (step as f64 * STEP_S).min(duration_s);
            Point2::from(path.pose(at_s).translation.vector)
        };
        let start = path.pose(0.0);
        let mut places = vec![Point2::from(start.translation.vector)];
        for step in 1..=(duration_s / STEP_S).ceil() as usize {
            let (next, mut last) = (place(step), places[places.len() - 1]);
            while (next - last).norm() >= STEP_M {
                last += (next - last).normalize() * STEP_M;
                places.push(last);
            }
        }
        let course = |at: usize| {
            let ends = [at.saturating_sub(1), (at + 1).min(places.len() - 1)];
            let along = places[ends[1]] - places[ends[0]];
            match along.norm() > 0.0 {
                true => along.y.atan2(along.x),
                false => start.rotation.angle(),
            }
        };
        let nodes = (0..places.len()).map(|at| Pose::new(places[at].coords, course(at)));
        Self {
            nodes: nodes.collect(),
            closed,
        }
    }

    pub fn length_m(&self) -> f64 {
        self.nodes.len() as f64 * STEP_M
    }

    /// The place after a distance, metres; none before the start or beyond the end of an open
    /// route.
    pub fn at(&self, distance_m: f64) -> Option<Pose> {
        let count = self.nodes.len();
        let along = distance_m / STEP_M;
        let along = match self.closed {
            true => along.rem_euclid(count as f64),
            false => along,
        };
        if !(0.0..=(count - 1) as f64).contains(&along) && !self.closed {
            return None;
        }
        let first = (along as usize).min(count - 1);
        let next = match (first + 1 < count, self.closed) {
            (true, _) => first + 1,
            (false, true) => 0,
            (false, false) => first,
        };
        let (from, to, share) = (&self.nodes[first], &self.nodes[next], along - first as f64);
        let turn_rad = from.rotation.rotation_to(&to.rotation).angle();
        let place = from.translation.vector.lerp(&to.translation.vector, share);
        Some(Pose::new(place, from.rotation.angle() + share * turn_rad))
    }

    /// The frame beside the street after a distance: its origin lies so far beyond the kerb, x
    /// along the street, y away from it.
    pub fn beside(&self, side: Side, distance_m: f64, beyond_m: f64) -> Option<Pose> {
        let node = self.at(distance_m)?;
        let aside_m = KERBS_M[side as usize] + beyond_m;
        let (place, turn_rad) = match side {
            Side::Left => (node * Point2::new(0.0, aside_m), 0.0),
            Side::Right => (node * Point2::new(0.0, -aside_m), PI),
        };
        Some(Pose::new(place.coords, node.rotation.angle() + turn_rad))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::{BlockLoop, SplinePath};

    #[test]
    fn a_lap_is_closed_and_as_long_as_the_path() {
        let block = BlockLoop::new(48.0, 34.0, 9.5, 5.0);
        let route = Route::along(&block);
        assert!((route.length_m() - block.lap_m()).abs() < 2.0);
        for metre in 0..400 {
            let [from, to] = [0.0, 1.0].map(|more| route.at(f64::from(metre) + more).unwrap());
            let way = from.inv_mul(&to);
            assert!(way.translation.x > 0.5 && way.translation.x < 2.1, "{way}");
            assert!(way.translation.y.abs() < 0.2, "{way}");
        }
    }

    #[test]
    fn a_vehicle_that_stands_stays_on_its_route_and_an_open_route_ends() {
        let poses: Vec<_> = [0.0, 5.0, 10.0, 10.0, 10.0, 10.0, 15.0, 20.0]
            .iter()
            .zip(0..)
            .map(|(x, at)| (f64::from(at), gyre_geometry::pose(*x, 0.0, 0.0)))
            .collect();
        let route = Route::along(&SplinePath::measured(&poses));
        assert!((18..=21).contains(&route.nodes.len()), "{route:?}");
        assert!(route.at(-0.5).is_none() && route.at(40.0).is_none());
        let left = route.beside(Side::Left, 5.0, 1.0).unwrap();
        assert!(
            (left.translation.y - KERBS_M[0] - 1.0).abs() < 0.3,
            "{left}"
        );
    }
}
