//! The scenery along the streets: houses whose walls hide the space behind, fences, trees, posts
//! and parked cars. One seed determines all of it.
//!
//! In real scans a row of houses appears as short bright pieces and dots with gaps between. So a
//! front consists of bays, each with its own strength: rough wall, relief between the bays, and
//! windows (reveals that face along the street, a pane that flashes, a room that extends the echo).

use std::collections::HashSet;

use gyre_geometry::Pose;
use nalgebra::{Point2, Rotation2, Vector2};
use rand::Rng;
use rand_chacha::ChaCha8Rng;
use rand_distr::StandardNormal;

use crate::body::{Body, NO_BODY, Scatterer, Wall};
use crate::cars::car;
use crate::error::SimulatorError;
use crate::route::{KERBS_M, Route, STEP_M, Side};
use crate::stream::Stream;

/// Side of the squares, metres; each square has room for one thing.
const SQUARE_M: f64 = 1.0;
/// Width of the free lanes: distance of all things from the vehicle and from oncoming cars, metres.
const CLEAR_M: f64 = 2.5;
/// Distances beyond the kerb of parked cars, posts, trees and fences, metres.
const PARKED_M: f64 = 1.3;
const POSTS_M: f64 = 3.0;
const FENCES_M: f64 = 4.0;
/// Depth of the front gardens beyond the kerb, metres.
const GARDENS_M: std::ops::Range<f64> = 4.5..8.0;
/// Width and depth of houses, metres, and the same of halls and flats behind them.
const HOUSE_M: [std::ops::Range<f64>; 2] = [7.0..16.0, 7.0..11.0];
const HALL_M: [std::ops::Range<f64>; 2] = [14.0..30.0, 10.0..16.0];
/// Distance of those from the kerb, metres.
const HALLS_M: std::ops::Range<f64> = 24.0..90.0;
/// Two-way share of the power that passes a wall of a house and a hedge or fence.
const HOUSE_TRANSMISSION: f64 = 0.1;
const FENCE_TRANSMISSION: f64 = 0.6;
/// Scatterers of a tunnel's lining in a metre, and the cross-section of each, square metres.
const LINING_PER_M: usize = 20;
const LINING_M2: f64 = 0.15;
/// Distance of the scatterers from the wall, metres.
const ROUGH_M: f64 = 0.02;
/// Two-way share of the power that passes a wall of a tunnel.
const TUNNEL_TRANSMISSION: f64 = 1e-9;
/// The body of these walls, above all others of the scenery.
const TUNNEL_BODY: u32 = (1 << 24) - 1;

pub(crate) fn build(route: &Route, seed: u64) -> Body {
    let mut site = Site {
        route,
        built: Body::default(),
        bodies: NO_BODY,
        taken: lanes(route),
        rng: Stream::SCENERY.generator(seed),
    };
    for side in Side::BOTH {
        site.furnish_kerb(side);
    }
    for side in Side::BOTH {
        site.line_with_houses(side);
    }
    for side in Side::BOTH {
        site.fill_behind(side);
    }
    site.built
}

type Square = (i64, i64);

/// The squares that stay free: near the vehicle's lane and near the lane of oncoming cars.
fn lanes(route: &Route) -> HashSet<Square> {
    let reach = (CLEAR_M / SQUARE_M).ceil() as i64;
    let mut taken = HashSet::new();
    for node in &route.nodes {
        for aside_m in [0.0, KERBS_M[0] - KERBS_M[1]] {
            let place = node * Point2::new(0.0, aside_m);
            let (column, row) = square(place);
            let near =
                (-reach..=reach).flat_map(|x| (-reach..=reach).map(move |y| (column + x, row + y)));
            taken.extend(near.filter(|(x, y)| {
                let middle = Point2::new(*x as f64 + 0.5, *y as f64 + 0.5) * SQUARE_M;
                (middle - place).norm() < CLEAR_M
            }));
        }
    }
    taken
}

fn square(place: Point2<f64>) -> Square {
    let at = place / SQUARE_M;
    (at.x.floor() as i64, at.y.floor() as i64)
}

struct Site<'a> {
    route: &'a Route,
    built: Body,
    bodies: u32,
    taken: HashSet<Square>,
    rng: ChaCha8Rng,
}

impl Site<'_> {
    /// Lamp posts, trees and parked cars.
    fn furnish_kerb(&mut self, side: Side) {
        let length_m = self.route.length_m();
        let mut at_m = self.rng.random_range(0.0..10.0);
        while at_m < length_m {
            if let Some(frame) = self.route.beside(side, at_m, PARKED_M)
                && self.rng.random_bool(0.5)
                && self.take(&frame, [-2.5, 2.5], [-1.0, 1.0])
            {
                let body = self.body();
                let parked = car(body, &mut self.rng);
                let places = parked.scatterers.iter().map(|part| part.moved(&frame));
                self.built.scatterers.extend(places);
                let walls = parked.walls.iter().map(|wall| wall.moved(&frame));
                self.built.walls.extend(walls);
            }
            at_m += self.rng.random_range(5.5..9.0);
        }
        let mut at_m = self.rng.random_range(0.0..20.0);
        while at_m < length_m {
            if let Some(frame) = self.route.beside(side, at_m, POSTS_M)
                && self.take(&frame, [-0.4, 0.4], [-0.4, 0.4])
            {
                match self.rng.random_bool(0.5) {
                    true => self.post(&frame),
                    false => self.tree(&frame),
                }
            }
            at_m += self.rng.random_range(9.0..22.0);
        }
    }

    /// A pole with its foot and its door, close together.
    fn post(&mut self, frame: &Pose) {
        for median_m2 in [3.0, 1.0, 0.5] {
            let place = Point2::new(self.normal() * 0.1, self.normal() * 0.1);
            let cross_section_m2 = median_m2 * 10f64.powf(0.2 * self.normal());
            let post = Scatterer::all_round(frame * place, cross_section_m2, NO_BODY);
            self.built.scatterers.push(post);
        }
    }

    fn tree(&mut self, frame: &Pose) {
        let trunk = Scatterer::all_round(frame * Point2::origin(), 2.0, NO_BODY);
        self.built.scatterers.push(trunk);
        for _ in 0..24 {
            let place = Point2::new(self.normal(), self.normal());
            let leaf = Scatterer::all_round(frame * place, 0.15, NO_BODY);
            self.built.scatterers.push(leaf);
        }
    }

    /// Houses, in rows and alone, with fences and gardens between them.
    fn line_with_houses(&mut self, side: Side) {
        let mut at_m = 0.0;
        let mut setback_m = self.rng.random_range(GARDENS_M);
        while at_m < self.route.length_m() {
            let [width_m, depth_m] = HOUSE_M.map(|range| self.rng.random_range(range));
            if !self.house(side, [at_m, setback_m], [width_m, depth_m]) {
                at_m += 2.0;
                continue;
            }
            self.garden(side, [at_m, at_m + width_m], setback_m);
            at_m += width_m;
            if self.rng.random_bool(0.5) {
                let gap_m = self.rng.random_range(3.0..12.0);
                self.fence(side, [at_m, at_m + gap_m]);
                at_m += gap_m;
                setback_m = self.rng.random_range(GARDENS_M);
            }
        }
    }

    /// Larger buildings behind the houses, which are seen through the gaps.
    fn fill_behind(&mut self, side: Side) {
        let mut at_m = self.rng.random_range(0.0..20.0);
        while at_m < self.route.length_m() {
            let [width_m, depth_m] = HALL_M.map(|range| self.rng.random_range(range));
            let setback_m = self.rng.random_range(HALLS_M);
            self.house(side, [at_m, setback_m], [width_m, depth_m]);
            at_m += self.rng.random_range(6.0..16.0);
        }
    }

    /// Builds a house, if there is room for it: its place along the street and beyond the kerb, its
    /// width and depth, metres.
    fn house(&mut self, side: Side, at: [f64; 2], [width_m, depth_m]: [f64; 2]) -> bool {
        let [at_m, setback_m] = at;
        let Some(middle) = self.route.beside(side, at_m + width_m / 2.0, setback_m) else {
            return false;
        };
        let half_m = width_m / 2.0;
        if !self.take(&middle, [-half_m, half_m], [0.0, depth_m]) {
            return false;
        }
        let body = self.body();
        let corners = [
            (-half_m, 0.0),
            (half_m, 0.0),
            (half_m, depth_m),
            (-half_m, depth_m),
        ];
        let corners = corners.map(|(x, y)| middle * Point2::new(x, y));
        let bay_m = self.rng.random_range(2.2..3.8);
        for number in 0..4 {
            let detail = if number == 0 { 1.0 } else { 0.4 };
            let (from, to) = (corners[number], corners[(number + 1) % 4]);
            self.front([from, to], bay_m, detail, body);
            let outward = corners[number] - nalgebra::center(&corners[0], &corners[2]);
            self.facing(from, outward, 0.5, 3.0 * detail, body);
        }
        true
    }

    /// Bushes, steps and bins before a house.
    fn garden(&mut self, side: Side, [from_m, to_m]: [f64; 2], setback_m: f64) {
        for _ in 0..((to_m - from_m) / 2.5) as usize {
            let at_m = self.rng.random_range(from_m..to_m);
            let beyond_m = self.rng.random_range(FENCES_M..setback_m);
            let Some(frame) = self.route.beside(side, at_m, beyond_m) else {
                continue;
            };
            if self.take(&frame, [-0.1, 0.1], [-0.1, 0.1]) {
                for _ in 0..5 {
                    let place = Point2::new(0.4 * self.normal(), 0.2 * self.normal());
                    let cross_section_m2 = 0.2 * 10f64.powf(0.4 * self.normal());
                    let bush = Scatterer::all_round(frame * place, cross_section_m2, NO_BODY);
                    self.built.scatterers.push(bush);
                }
            }
        }
    }

    fn fence(&mut self, side: Side, [from_m, to_m]: [f64; 2]) {
        let Some(frame) = self.route.beside(side, 0.5 * (from_m + to_m), FENCES_M) else {
            return;
        };
        let half_m = 0.5 * (to_m - from_m) - 0.5;
        if !self.take(&frame, [-half_m, half_m], [-0.1, 0.1]) {
            return;
        }
        let body = self.body();
        let [from, to] = [-half_m, half_m].map(|x| frame * Point2::new(x, 0.0));
        let fence = Wall::new(from, to, FENCE_TRANSMISSION, body);
        self.built.walls.push(fence);
        for post in 0..(6.0 * half_m) as usize {
            let place = from + (to - from) * (post as f64 / (6.0 * half_m));
            let cross_section_m2 = 0.3 * 10f64.powf(0.4 * self.normal());
            let post = Scatterer::all_round(place, cross_section_m2, body);
            self.built.scatterers.push(post);
        }
    }

    /// A wall of a house, seen from outside; outside is on the right when going from its first end
    /// to its second.
    fn front(&mut self, [from, to]: [Point2<f64>; 2], bay_m: f64, detail: f64, body: u32) {
        let wall = Wall::new(from, to, HOUSE_TRANSMISSION, body);
        self.built.walls.push(wall);
        let length_m = (to - from).norm();
        let along = (to - from) / length_m;
        let outward = Vector2::new(along.y, -along.x);
        let bays = (length_m / bay_m).round().max(1.0);
        let width_m = length_m / bays;
        for bay in 0..bays as usize {
            let start = from + along * (bay as f64 * width_m);
            let strength = detail * 10f64.powf(0.5 * self.normal());
            let at = |along_m: f64, out_m: f64| start + along * along_m + outward * out_m;
            let mut rough_m = 0.0;
            while rough_m < width_m {
                let place = at(rough_m, self.rng.random_range(0.0..0.15));
                self.facing(place, outward, 1.5, 0.15 * strength, body);
                rough_m += self.rng.random_range(0.1..0.35) / detail;
            }
            // Pilasters and gutters are visible along the street from far away.
            let relief_m2 = if self.rng.random_bool(0.15) { 5.0 } else { 1.6 };
            self.facing(at(0.0, 0.1), outward, 0.4, relief_m2 * strength, body);
            if !self.rng.random_bool(0.5) {
                continue;
            }
            let (middle_m, half_m) = (width_m / 2.0, self.rng.random_range(0.3..0.8));
            for end in [-1.0, 1.0] {
                let turn = Rotation2::new(end * self.rng.random_range(0.7..1.4));
                let sharpness = self.rng.random_range(2.0..10.0);
                let place = at(middle_m + end * half_m, 0.05);
                self.facing(place, turn * outward, sharpness, 10.0 * strength, body);
            }
            // Panes are not quite parallel to their wall.
            let pane = Rotation2::new(0.02 * self.normal()) * outward;
            self.facing(at(middle_m, 0.0), pane, 250.0, 40.0, body);
            for _ in 0..(4.0 * detail).round() as usize {
                let depth_m = -1.8 * (1.0 - self.rng.random::<f64>()).ln();
                let aside_m = self.rng.random_range(-half_m..half_m);
                let place = at(middle_m + aside_m, -depth_m.min(4.0));
                self.facing(place, outward, 1.5, 0.3 * strength, body);
            }
        }
    }

    /// Adds a scatterer that reflects mainly in one direction; its cross-section is the median.
    fn facing(
        &mut self,
        position: Point2<f64>,
        direction: Vector2<f64>,
        sharpness: f64,
        median_m2: f64,
        body: u32,
    ) {
        let cross_section_m2 = median_m2 * 10f64.powf(0.3 * self.normal());
        let normal = direction.normalize();
        let part = Scatterer::facing(position, cross_section_m2, normal, sharpness, body);
        self.built.scatterers.push(part);
    }

    /// Takes a rectangle of a frame, unless something stands there.
    fn take(&mut self, frame: &Pose, x: [f64; 2], y: [f64; 2]) -> bool {
        let steps = |[from, to]: [f64; 2]| {
            let count = ((to - from) / (0.7 * SQUARE_M)).ceil() as usize;
            (0..=count).map(move |step| from + (to - from) * step as f64 / count as f64)
        };
        let places = steps(x).flat_map(|x| steps(y).map(move |y| Point2::new(x, y)));
        let squares: HashSet<Square> = places.map(|place| square(frame * place)).collect();
        let is_free = squares.is_disjoint(&self.taken);
        if is_free {
            self.taken.extend(squares);
        }
        is_free
    }

    fn body(&mut self) -> u32 {
        self.bodies += 1;
        self.bodies
    }

    fn normal(&mut self) -> f64 {
        self.rng.sample(StandardNormal)
    }
}

/// Builds a tunnel that begins after a distance, with a length, metres: walls without structure
/// along a stretch of the drive, and what stands in it goes. Inside a radar sees two smooth lines
/// and nothing else until a portal comes into its range: how far it drives is not determined.
pub(crate) fn build_tunnel(
    [from_m, length_m]: [f64; 2],
    scenery: &mut Body,
    route: &Route,
    seed: u64,
) -> Result<(), SimulatorError> {
    let count = (length_m / STEP_M) as usize;
    let nodes = (0..=count).map(|at| route.at(from_m + at as f64 * STEP_M));
    let Some(nodes) = nodes.collect::<Option<Vec<_>>>() else {
        let value = format!("[{from_m}, {length_m}]");
        let expected = format!(
            "a tunnel that ends before the drive, which is {:.0} m long",
            route.length_m()
        );
        return Err(SimulatorError::key("tunnel_m", value, expected));
    };
    let is_inside = |place: Point2<f64>| {
        nodes.iter().any(|node| {
            let there = node.inverse_transform_point(&place);
            there.x.abs() <= STEP_M && (-KERBS_M[1]..=KERBS_M[0]).contains(&there.y)
        })
    };
    scenery.scatterers.retain(|it| !is_inside(it.position));
    scenery.walls.retain(|wall| {
        let middle = nalgebra::center(&wall.from, &wall.to);
        ![wall.from, middle, wall.to].into_iter().any(is_inside)
    });
    let rng = &mut Stream::TUNNEL.generator(seed);
    for (side, aside_m) in [1.0, -1.0].into_iter().zip(KERBS_M) {
        for piece in nodes.windows(2) {
            let [from, to] = [0, 1].map(|end| piece[end] * Point2::new(0.0, side * aside_m));
            let wall = Wall::new(from, to, TUNNEL_TRANSMISSION, TUNNEL_BODY);
            scenery.walls.push(wall);
            let inwards = piece[0].rotation * Vector2::new(0.0, -side);
            scenery.scatterers.extend((0..LINING_PER_M).map(|at| {
                let share = (at as f64 + rng.random_range(0.25..0.75)) / LINING_PER_M as f64;
                let position =
                    from + (to - from) * share + inwards * rng.random_range(0.0..ROUGH_M);
                Scatterer::facing(position, LINING_M2, inwards, 1.0, TUNNEL_BODY)
            }));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::path::{BlockLoop, SplinePath};

    #[test]
    fn both_sides_are_lined_and_both_lanes_are_free() {
        let route = Route::along(&BlockLoop::new(80.0, 60.0, 9.5, 5.0));
        let built = build(&route, 1);
        assert!(built.walls.len() > 100 && built.scatterers.len() > 3000);
        let lane_m = |place: Point2<f64>, aside_m: f64| {
            let places = route
                .nodes
                .iter()
                .map(|node| node * Point2::new(0.0, aside_m));
            places
                .map(|lane| (lane - place).norm())
                .fold(f64::INFINITY, f64::min)
        };
        for scatterer in &built.scatterers {
            for aside_m in [0.0, KERBS_M[0] - KERBS_M[1]] {
                let off_m = lane_m(scatterer.position, aside_m);
                assert!(off_m > 1.0, "{scatterer:?} stands {off_m} m from a lane");
            }
        }
        let near = |side: f64| {
            let is_near = |at: usize| {
                let place = route.nodes[at] * Point2::new(0.0, side * 12.0);
                let apart_m = |other: &Scatterer| (other.position - place).norm();
                built.scatterers.iter().any(|other| apart_m(other) < 8.0)
            };
            (0..route.nodes.len()).filter(|at| is_near(*at)).count() as f64 * STEP_M
        };
        for side in [-1.0, 1.0] {
            assert!(near(side) > 0.9 * route.length_m(), "{}", near(side));
        }
    }

    fn straight() -> Route {
        let nodes = (0..40).map(|k| {
            let second = f64::from(k);
            (second, gyre_geometry::pose(5.0 * second, 0.0, 0.0))
        });
        Route::along(&SplinePath::measured(&nodes.collect::<Vec<_>>()))
    }

    #[test]
    fn what_stands_in_the_way_goes_and_the_walls_hide_the_rest() {
        let post = |x: f64, y: f64| Scatterer::all_round(Point2::new(x, y), 1.0, NO_BODY);
        let mut scenery = Body {
            scatterers: vec![post(80.0, 2.0), post(80.0, 3.5), post(20.0, 0.0)],
            walls: Vec::new(),
        };
        build_tunnel([50.0, 100.0], &mut scenery, &straight(), 1).unwrap();
        let posts = scenery.scatterers.iter().filter(|it| it.body == NO_BODY);
        assert_eq!(posts.count(), 2);
        assert_eq!(scenery.walls.len(), 200);
        let sides = scenery.walls.iter().map(|wall| wall.from.y);
        let is_beside = |y: f64| (y - KERBS_M[0]).abs() < 0.1 || (y + KERBS_M[1]).abs() < 0.1;
        assert!(sides.clone().all(is_beside));
    }

    #[test]
    fn a_tunnel_beyond_the_end_of_the_drive_is_refused() {
        let refused = build_tunnel([150.0, 100.0], &mut Body::default(), &straight(), 1);
        let text = refused.unwrap_err().to_string();
        assert!(
            text.contains("`tunnel_m` is [150, 100]") && text.contains("m long"),
            "{text}"
        );
    }
}
