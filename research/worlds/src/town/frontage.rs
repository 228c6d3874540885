//! One side of a street: its kerb and the land beyond.

use gyre_geometry::Pose;
use nalgebra::{Point2, Vector2};

use super::land::Lot;
use super::random::hash;
use crate::streets::{Street, Streets};

/// Distance between the nodes of a street's line, metres.
const NODE_M: f64 = 2.0;
/// Distance to either side over which the direction is averaged, metres, since driven lines waver.
const TANGENT_M: f64 = 5.0;
/// Maximum distance along the street between a place's own station and its nearest point of a
/// street, metres.
const OWN_M: f64 = 8.0;

/// The centre line of a street, by distance along it.
pub(super) struct Line {
    /// Places, [`NODE_M`] apart along the street.
    nodes: Vec<Point2<f64>>,
    length_m: f64,
    /// The seed of the street: where it begins. Its index and its end change when the network
    /// grows.
    key: u64,
}

impl Line {
    pub(super) fn new(street: &Street) -> Self {
        let mut nodes = vec![street.centre[0]];
        let mut passed_m = 0.0;
        for ends in street.centre.windows(2) {
            let (direction, length_m) = (ends[1] - ends[0], (ends[1] - ends[0]).norm());
            while nodes.len() as f64 * NODE_M <= passed_m + length_m {
                nodes.push(
                    ends[0] + direction * ((nodes.len() as f64 * NODE_M - passed_m) / length_m),
                );
            }
            passed_m += length_m;
        }
        let cell = |metres: f64| (4.0 * metres).round() as i64 as u64;
        let (start, next) = (nodes[0], nodes[nodes.len().min(5) - 1]);
        let key = hash(&[
            cell(start.x),
            cell(start.y),
            cell(next.x / 4.0),
            cell(next.y / 4.0),
        ]);
        Self {
            length_m: (nodes.len() - 1) as f64 * NODE_M,
            nodes,
            key,
        }
    }

    fn centre(&self, along_m: f64) -> Point2<f64> {
        let at = (along_m / NODE_M).clamp(0.0, (self.nodes.len() - 1) as f64);
        let node = (at as usize).min(self.nodes.len().saturating_sub(2));
        let next = self.nodes[(node + 1).min(self.nodes.len() - 1)];
        self.nodes[node] + (next - self.nodes[node]) * (at - node as f64)
    }

    /// Unit vector along the street.
    fn direction(&self, along_m: f64) -> Vector2<f64> {
        let direction = self.centre(along_m + TANGENT_M) - self.centre(along_m - TANGENT_M);
        direction.try_normalize(1e-6).unwrap_or_else(Vector2::x)
    }
}

/// One side of a street.
#[derive(Clone, Copy)]
pub(super) struct Frontage<'a> {
    streets: &'a Streets,
    line: &'a Line,
    street: usize,
    half_width_m: f64,
    /// 1 to the left of the street's direction, -1 to the right.
    side: f64,
}

impl<'a> Frontage<'a> {
    /// Both sides of a street.
    pub(super) fn sides(streets: &'a Streets, street: usize, line: &'a Line) -> [Self; 2] {
        let half_width_m = streets.streets()[street].half_width_m;
        [1.0, -1.0].map(|side| Self {
            streets,
            line,
            street,
            half_width_m,
            side,
        })
    }

    pub(super) fn length_m(&self) -> f64 {
        self.line.length_m
    }

    /// The seed that both sides share.
    pub(super) fn street_key(&self) -> u64 {
        self.line.key
    }

    /// Offset of this side's regular objects, as a share of their distance.
    pub(super) fn phase(&self) -> f64 {
        if self.side > 0.0 { 0.0 } else { 0.5 }
    }

    /// The seed of this side.
    pub(super) fn key(&self) -> u64 {
        self.line.key ^ self.side_key()
    }

    /// The seed of this side that all streets share.
    pub(super) fn side_key(&self) -> u64 {
        u64::from(self.side < 0.0)
    }

    /// A place `out_m` metres beyond the kerb.
    pub(super) fn place(&self, along_m: f64, out_m: f64) -> Point2<f64> {
        let direction = self.line.direction(along_m);
        let left = Vector2::new(-direction.y, direction.x);
        self.line.centre(along_m) + left * (self.side * (self.half_width_m + out_m))
    }

    /// A frame `out_m` metres beyond the kerb: x along it, y away from the street.
    pub(super) fn frame(&self, along_m: f64, out_m: f64) -> Pose {
        let along = self.line.direction(along_m) * self.side;
        Pose::new(self.place(along_m, out_m).coords, along.y.atan2(along.x))
    }

    /// Returns whether a place belongs to this side: no other street, and no other part of this
    /// one, is nearer.
    pub(super) fn owns(&self, along_m: f64, place: Point2<f64>) -> bool {
        let nearest = self.streets.nearest(place, 30.0);
        nearest.is_some_and(|found| {
            found.street == self.street && (found.along_m - along_m).abs() < OWN_M
        })
    }

    /// Returns whether a place is at least `metres` from all kerbs.
    pub(super) fn is_clear(&self, place: Point2<f64>, metres: f64) -> bool {
        self.streets.clearance_m(place, metres) >= metres
    }

    /// The largest rectangle with its front along the kerb between two stations, `out_m` metres
    /// beyond it; none where the street bends too sharply. It may overlap other streets.
    pub(super) fn lot(&self, along_m: f64, width_m: f64, out_m: f64, depth_m: f64) -> Option<Lot> {
        let [front, back] = [out_m, out_m + depth_m].map(|out| {
            let (from, to) = (self.place(along_m, out), self.place(along_m + width_m, out));
            if self.side > 0.0 {
                (from, to)
            } else {
                (to, from)
            }
        });
        let direction = (front.1 - front.0).try_normalize(1e-6)?;
        let usable_m = (front.1 - front.0)
            .norm()
            .min((back.1 - back.0).dot(&direction));
        if usable_m < 0.6 * width_m {
            return None;
        }
        let origin = nalgebra::center(&front.0, &front.1) - direction * (usable_m / 2.0);
        let pose = Pose::new(origin.coords, direction.y.atan2(direction.x));
        Some(Lot {
            pose,
            width_m: usable_m,
            frontage_m: width_m,
            depth_m,
        })
    }
}
