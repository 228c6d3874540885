//! Belts: high stone walls and dense woods along a street, without gaps for hundreds of metres.
//!
//! They are what RADIATE's scans of Edinburgh have and rows of houses have not: continuous lines,
//! by which the way along the street is hard to tell, wide areas of speckle, and nothing behind
//! them.

use std::ops::Range;

use nalgebra::{Point2, Vector2};
use rand::Rng;
use rand_chacha::ChaCha8Rng;

use super::frontage::Frontage;
use super::random::{generator, hash, smooth, spread};
use super::site::Built;
use crate::body::{NO_BODY, Scatterer, Wall};

/// Number of stretches of 72 m that a belt lasts.
const STRETCHES: u64 = 2;
/// Share of the belts that are stone walls; the others are woods.
const STONE: f64 = 0.7;
/// Length of a piece, which follows the bends, metres.
const PIECE_M: f64 = 2.0;
/// Minimum distance from all kerbs, metres.
const CLEAR_M: f64 = 1.0;

/// Rubble stone: faces of some decimetres, several in each resolution cell, stronger and weaker by
/// the metre. Number and cross-section are assumed.
const STONES_M: f64 = 0.14;
const STONE_M2: f64 = 0.6;
const STONE_SPREAD_DB: f64 = 4.0;
const STONE_TRANSMISSION: f64 = 1e-3;

/// Woods: boughs and bushes, several in each resolution cell, in clumps. A metre of foliage
/// attenuates by 1.55 dB one way at 77 GHz (Weissberger 1982).
const WOOD_DEPTH_M: Range<f64> = 2.5..8.0;
const WOOD_A_M2: f64 = 3.0;
const WOOD_M2: f64 = 0.2;
const WOOD_SPREAD_DB: f64 = 4.0;
const CLUMP_M: f64 = 7.0;
/// Distance between the rows of foliage, metres, and the two-way share that passes each.
const ROWS_M: f64 = 1.5;
const ROW_TRANSMISSION: f64 = 0.34;

/// A belt along a stretch of one side of a street.
pub(super) struct Belt<'a> {
    frontage: Frontage<'a>,
    along_m: Range<f64>,
    /// Distance from the kerb, metres.
    out_m: f64,
    key: u64,
    rng: ChaCha8Rng,
}

impl<'a> Belt<'a> {
    /// The belt along a stretch by its number, on a `share` of all.
    pub(super) fn draw(
        frontage: Frontage<'a>,
        along_m: Range<f64>,
        out_m: f64,
        [seed, number]: [u64; 2],
        share: f64,
    ) -> Option<Self> {
        let key = hash(&[seed, frontage.key(), number / STRETCHES, 5]);
        let is_there = generator(&[key]).random_bool(share);
        is_there.then(|| Self {
            frontage,
            along_m,
            out_m,
            key,
            rng: generator(&[key, number]),
        })
    }

    pub(super) fn build(&mut self, built: &mut Built) {
        let mut kind = generator(&[self.key, 1]);
        let (stone, depth_m) = (kind.random_bool(STONE), kind.random_range(WOOD_DEPTH_M));
        let mut along_m = self.along_m.start;
        while along_m < self.along_m.end {
            if self.is_free(along_m) {
                if stone {
                    self.stones(along_m, built);
                } else {
                    self.wood(along_m, depth_m, built);
                }
            }
            along_m += PIECE_M;
        }
    }

    fn is_free(&self, along_m: f64) -> bool {
        [0.0, PIECE_M].into_iter().all(|more_m| {
            let place = self.frontage.place(along_m + more_m, self.out_m);
            self.frontage.is_clear(place, CLEAR_M) && self.frontage.owns(along_m + more_m, place)
        })
    }

    fn stones(&mut self, along_m: f64, built: &mut Built) {
        let (from, to) = self.ends(along_m, self.out_m);
        let body = built.next_body();
        let wall = Wall {
            mirror: 0.05,
            ..Wall::rough(from, to, STONE_TRANSMISSION, body)
        };
        built.content.walls.push(wall);
        let median_m2 = spread(&mut self.rng, STONE_M2, STONE_SPREAD_DB);
        for _ in 0..(PIECE_M / STONES_M) as usize {
            let uneven = Vector2::from_fn(|_, _| self.rng.random_range(-0.08..0.08));
            let place = from + (to - from) * self.rng.random::<f64>() + uneven;
            let cross_section_m2 = spread(&mut self.rng, median_m2, STONE_SPREAD_DB);
            built
                .content
                .scatterers
                .push(Scatterer::all_round(place, cross_section_m2, body));
        }
    }

    fn wood(&mut self, along_m: f64, depth_m: f64, built: &mut Built) {
        let rows = (depth_m / ROWS_M) as usize;
        for row in (0..rows).map(|row| (row as f64 + 0.5) * ROWS_M) {
            let (from, to) = self.ends(along_m, self.out_m + row);
            if ![from, to]
                .iter()
                .all(|end| self.frontage.is_clear(*end, CLEAR_M))
            {
                continue;
            }
            let passed = ROW_TRANSMISSION.powf(self.cover(from));
            built
                .content
                .walls
                .push(Wall::rough(from, to, passed, NO_BODY));
        }
        for _ in 0..(PIECE_M * depth_m * WOOD_A_M2) as usize {
            let (along, out) = (
                self.rng.random_range(0.0..PIECE_M),
                self.rng.random_range(0.0..depth_m),
            );
            let place = self.frontage.place(along_m + along, self.out_m + out);
            let median_m2 = WOOD_M2 * self.cover(place);
            if median_m2 > 0.0 && self.frontage.is_clear(place, CLEAR_M) {
                let cross_section_m2 = spread(&mut self.rng, median_m2, WOOD_SPREAD_DB);
                built.content.scatterers.push(Scatterer::all_round(
                    place,
                    cross_section_m2,
                    NO_BODY,
                ));
            }
        }
    }

    /// Density of the foliage at a place: 0 between clumps to 1.
    fn cover(&self, place: Point2<f64>) -> f64 {
        (2.5 * smooth(self.key, place, CLUMP_M) - 0.4).clamp(0.0, 1.0)
    }

    fn ends(&self, along_m: f64, out_m: f64) -> (Point2<f64>, Point2<f64>) {
        let [from, to] = [0.0, PIECE_M].map(|more_m| self.frontage.place(along_m + more_m, out_m));
        (from, to)
    }
}
