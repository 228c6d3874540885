//! All streets of a town, indexed by place.

use nalgebra::{Point2, Vector2};

use super::street::Street;

/// Side of a cell of the index, metres.
const CELL_M: f64 = 20.0;
/// Maximum number of cells: larger towns have larger cells.
const MAX_CELLS: f64 = 1e6;

/// The position of a place relative to the nearest street.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// Index of the street.
    pub street: usize,
    /// Metres along the street's centre line.
    pub along_m: f64,
    /// Distance from the centre line, metres.
    pub offset_m: f64,
    /// Distance from the kerb, metres: negative on the carriageway.
    pub clearance_m: f64,
}

/// All streets of a town.
#[derive(Clone, Debug, Default)]
pub struct Streets {
    streets: Vec<Street>,
    widest_half_m: f64,
    corner: Point2<f64>,
    cell_m: f64,
    columns: usize,
    rows: usize,
    /// `starts[c]..starts[c + 1]` are the pieces of cell `c`.
    starts: Vec<u32>,
    pieces: Vec<Piece>,
}

/// A segment of a street's centre line.
#[derive(Clone, Copy, Debug)]
struct Piece {
    street: u32,
    half_width_m: f64,
    from: Point2<f64>,
    segment: Vector2<f64>,
    length_m: f64,
    along_m: f64,
}

impl Streets {
    /// Indexes the streets.
    pub fn new(streets: Vec<Street>) -> Self {
        let points = || streets.iter().flat_map(|street| &street.centre);
        let lowest = points().fold(Point2::new(f64::MAX, f64::MAX), |a, b| a.inf(b));
        let highest = points().fold(Point2::new(f64::MIN, f64::MIN), |a, b| a.sup(b));
        let size = if points().next().is_some() {
            highest - lowest
        } else {
            Vector2::zeros()
        };
        let cell_m = CELL_M
            .max((size.x * size.y / MAX_CELLS).sqrt())
            .max((size.x + size.y) / MAX_CELLS);
        let [columns, rows] = [size.x, size.y].map(|extent| (extent / cell_m) as usize + 1);
        let widest_half_m = streets
            .iter()
            .map(|street| street.half_width_m)
            .fold(0.0, f64::max);
        let (starts, pieces) = (Vec::new(), Vec::new());
        let mut network = Self {
            streets,
            widest_half_m,
            corner: lowest,
            cell_m,
            columns,
            rows,
            starts,
            pieces,
        };
        network.sort();
        network
    }

    /// The streets.
    pub fn streets(&self) -> &[Street] {
        &self.streets
    }

    /// The nearest street, if its kerb is less than `within_m` away.
    pub fn nearest(&self, place: Point2<f64>, within_m: f64) -> Option<Nearest> {
        if self.pieces.is_empty() {
            return None;
        }
        let reach = Vector2::repeat(within_m + self.widest_half_m);
        let [first, last] = [place - reach, place + reach].map(|p| (p - self.corner) / self.cell_m);
        let span = |from: f64, to: f64, end: usize| {
            let from = from.floor().max(0.0) as usize;
            from..((to.floor() + 1.0).clamp(0.0, end as f64) as usize).max(from)
        };
        let mut best: Option<Nearest> = None;
        for row in span(first.y, last.y, self.rows) {
            for column in span(first.x, last.x, self.columns) {
                for piece in self.cell(row * self.columns + column) {
                    let max_m = best.map_or(within_m, |best| best.clearance_m);
                    best = piece.nearer(place, max_m).or(best);
                }
            }
        }
        best
    }

    /// Distance from the nearest kerb, metres, negative on a carriageway, at most `within_m`.
    pub fn clearance_m(&self, place: Point2<f64>, within_m: f64) -> f64 {
        self.nearest(place, within_m)
            .map_or(within_m, |nearest| nearest.clearance_m)
    }

    fn cell(&self, cell: usize) -> &[Piece] {
        &self.pieces[self.starts[cell] as usize..self.starts[cell + 1] as usize]
    }

    /// Sorts all pieces into the cells that they may touch, in the order of the streets.
    fn sort(&mut self) {
        let mut found: Vec<(usize, Piece)> = Vec::new();
        for (number, street) in self.streets.iter().enumerate() {
            let mut along_m = 0.0;
            for ends in street.centre.windows(2) {
                let segment = ends[1] - ends[0];
                let (street, half_width_m) = (number as u32, street.half_width_m);
                let piece = Piece {
                    street,
                    half_width_m,
                    from: ends[0],
                    segment,
                    length_m: segment.norm(),
                    along_m,
                };
                along_m += piece.length_m;
                let cell = |p: Point2<f64>| (p - self.corner).map(|v| (v / self.cell_m) as usize);
                let (low, high) = (cell(ends[0].inf(&ends[1])), cell(ends[0].sup(&ends[1])));
                for row in low.y..=high.y {
                    found.extend(
                        (low.x..=high.x).map(|column| (row * self.columns + column, piece)),
                    );
                }
            }
        }
        found.sort_by_key(|(cell, _)| *cell);
        let before = |cell: usize| found.partition_point(|(c, _)| *c < cell) as u32;
        self.starts = (0..=self.columns * self.rows).map(before).collect();
        self.pieces = found.into_iter().map(|(_, piece)| piece).collect();
    }
}

impl Piece {
    /// The position of a place relative to the piece, if its kerb is less than `max_m` away.
    fn nearer(&self, place: Point2<f64>, max_m: f64) -> Option<Nearest> {
        let off = place - self.from;
        let share =
            (off.dot(&self.segment) / (self.length_m * self.length_m).max(1e-12)).clamp(0.0, 1.0);
        let apart = (off - self.segment * share).norm_squared();
        let reach_m = max_m + self.half_width_m;
        if reach_m <= 0.0 || apart >= reach_m * reach_m {
            return None;
        }
        let offset_m = apart.sqrt();
        Some(Nearest {
            street: self.street as usize,
            along_m: self.along_m + share * self.length_m,
            offset_m,
            clearance_m: offset_m - self.half_width_m,
        })
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used)]
    use std::f64::consts::FRAC_PI_2;

    use super::*;

    #[test]
    fn a_place_beside_a_bent_street_is_found_at_its_distance() {
        let centre = [(0.0, 0.0), (100.0, 0.0), (100.0, 50.0)]
            .map(|(x, y)| Point2::new(x, y))
            .to_vec();
        let streets = Streets::new(vec![Street {
            centre,
            half_width_m: 4.0,
            driven: true,
        }]);
        let nearest = streets.nearest(Point2::new(40.0, -7.0), 50.0).unwrap();
        assert_eq!(
            (nearest.along_m, nearest.offset_m, nearest.clearance_m),
            (40.0, 7.0, 3.0)
        );
        assert_eq!(
            streets
                .nearest(Point2::new(94.0, 30.0), 50.0)
                .unwrap()
                .along_m,
            130.0
        );
        assert_eq!(streets.clearance_m(Point2::new(40.0, 1.0), 5.0), -3.0);
        assert_eq!(streets.clearance_m(Point2::new(-400.0, 300.0), 5.0), 5.0);
        let bend = streets.streets()[0].at(130.0);
        assert!((bend.translation.vector - Vector2::new(100.0, 30.0)).norm() < 1e-9);
        assert!((bend.rotation.angle() - FRAC_PI_2).abs() < 1e-9);
    }
}
