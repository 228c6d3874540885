//! Houses: walls that hide what is behind them, made of scatterers that a radar sees as a facade.
//!
//! A facade is rough wall (many weak scatterers, whose echoes interfere: speckle), window frames, pipes and
//! recesses (fewer and stronger, each with its own direction), smooth panels that flash when seen at a right angle,
//! and two corners, the brightest to all sides. Cross-sections are chosen so that the histogram of received powers
//! comes near the one of real scans in a town.

use nalgebra::{Point2, Rotation2, Vector2};
use rand::Rng;

use super::random::{spread, stations};
use super::{Edge, Planner};
use crate::world::{Aspect, NO_BODY, Scatterer, Wall};

/// Power that passes one wall of a house, there and back.
const WALL_TRANSMISSION: f64 = 0.1;
/// Power that passes a fence, there and back.
const FENCE_TRANSMISSION: f64 = 0.5;
/// Depth of a house, metres.
const DEPTH_M: std::ops::Range<f64> = 8.0..12.0;

/// One wall of a house as the radar sees it from outside.
struct Facade {
    from: Point2<f64>,
    to: Point2<f64>,
    body: u32,
    /// Factor on the number of details: 1 towards the street, less on sides and backs.
    detail: f64,
}

impl Planner<'_> {
    /// Houses from one end of the edge to the other, or (not `whole`) between the houses round its corners.
    pub(super) fn row_of_houses(&mut self, edge: &Edge, whole: bool) {
        let margin = if whole { 0.0 } else { DEPTH_M.end };
        let end = edge.length_m - margin;
        let mut at = margin;
        while end - at > 6.0 {
            let frontage = self.rng.random_range(8.0..18.0f64).min(end - at);
            self.house(edge, at, frontage);
            at += frontage;
            if self.rng.random_bool(0.35) {
                let gap = self.rng.random_range(2.5..6.0f64).min((end - at).max(0.0));
                self.gap(edge, at, gap);
                at += gap;
            }
        }
    }

    fn house(&mut self, edge: &Edge, at: f64, frontage: f64) {
        let setback = if self.rng.random_bool(0.5) { 0.0 } else { self.rng.random_range(0.3..2.0) };
        let depth = self.rng.random_range(DEPTH_M).min(edge.half_block_m);
        if depth < setback + 1.0 {
            return;
        }
        let body = self.next_body();
        let corners = [(at, -setback), (at + frontage, -setback), (at + frontage, -depth), (at, -depth)]
            .map(|(along, out)| edge.at(along, out));
        for side in 0..4 {
            let detail = if side == 0 { 1.0 } else { 0.3 };
            self.facade(&Facade { from: corners[side], to: corners[(side + 1) % 4], body, detail });
        }
    }

    fn facade(&mut self, facade: &Facade) {
        let Facade { from, to, body, .. } = *facade;
        self.content.walls.push(Wall { from, to, transmission: WALL_TRANSMISSION, mirror: 0.0, body });
        self.rough_wall(facade);
        self.interior(facade);
        self.frames(facade);
        self.panels(facade);
        let cross_section_m2 = spread(&mut self.rng, 8.0, 4.0);
        self.add(Scatterer { position: from, cross_section_m2, aspect: Aspect::AllRound, body: facade.body });
    }

    fn rough_wall(&mut self, facade: &Facade) {
        for (position, normal) in self.places(facade, 0.1, 0.35, 0.15) {
            let cross_section_m2 = spread(&mut self.rng, 0.08, 4.0);
            let aspect = Aspect::Facing { normal, sharpness: 1.5 };
            self.add(Scatterer { position, cross_section_m2, aspect, body: facade.body });
        }
    }

    /// Window reveals, rooms behind the glass, eaves and roofs: what smears a facade out over range.
    fn interior(&mut self, facade: &Facade) {
        for (position, normal) in self.places(facade, 0.15, 0.6, 0.05) {
            let depth_m = -1.2 * (1.0 - self.rng.random::<f64>()).ln();
            let position = position - normal * depth_m.min(6.0);
            let cross_section_m2 = spread(&mut self.rng, 0.2, 6.0);
            let aspect = Aspect::Facing { normal, sharpness: 1.5 };
            self.add(Scatterer { position, cross_section_m2, aspect, body: facade.body });
        }
    }

    fn frames(&mut self, facade: &Facade) {
        for (position, normal) in self.places(facade, 0.4, 2.0, 0.3) {
            let turn = self.rng.random_range(-1.0..1.0);
            let normal = Rotation2::new(turn) * normal;
            let cross_section_m2 = spread(&mut self.rng, 4.0, 6.0);
            let sharpness = self.rng.random_range(2.0..25.0);
            let aspect = Aspect::Facing { normal, sharpness };
            self.add(Scatterer { position, cross_section_m2, aspect, body: facade.body });
        }
    }

    fn panels(&mut self, facade: &Facade) {
        for (position, normal) in self.places(facade, 1.5, 4.0, 0.05) {
            let cross_section_m2 = spread(&mut self.rng, 60.0, 5.0);
            let aspect = Aspect::Facing { normal, sharpness: 250.0 };
            self.add(Scatterer { position, cross_section_m2, aspect, body: facade.body });
        }
    }

    /// Random places on a facade, `least..most` metres apart, up to `relief` metres out of the wall, with its normal.
    fn places(&mut self, facade: &Facade, least: f64, most: f64, relief: f64) -> Vec<(Point2<f64>, Vector2<f64>)> {
        let way = facade.to - facade.from;
        let length = way.norm();
        let along = way / length;
        let normal = Vector2::new(along.y, -along.x);
        let distances = stations(&mut self.rng, length, least / facade.detail, most / facade.detail);
        distances
            .into_iter()
            .map(|at| (facade.from + along * at + normal * self.rng.random_range(0.0..relief), normal))
            .collect()
    }

    /// What closes the gap between two houses: a fence, or nothing.
    fn gap(&mut self, edge: &Edge, at: f64, width: f64) {
        if width < 1.0 || self.rng.random_bool(0.4) {
            return;
        }
        let body = self.next_body();
        let (from, to) = (edge.at(at, -0.5), edge.at(at + width, -0.5));
        self.content.walls.push(Wall { from, to, transmission: FENCE_TRANSMISSION, mirror: 0.0, body });
        for along in stations(&mut self.rng, width, 0.2, 0.6) {
            let cross_section_m2 = spread(&mut self.rng, 0.3, 5.0);
            let position = edge.at(at + along, -0.5);
            self.add(Scatterer { position, cross_section_m2, aspect: Aspect::AllRound, body });
        }
    }

    pub(super) fn add(&mut self, scatterer: Scatterer) {
        debug_assert!(scatterer.body != NO_BODY || scatterer.aspect == Aspect::AllRound);
        self.content.scatterers.push(scatterer);
    }
}
