use std::{fmt, ops::RangeInclusive};

use nalgebra::{Point2, Vector2};

/// Cells per side of a tile, as web maps have them.
pub const TILE_CELLS: usize = 256;

pub(crate) const CELLS: usize = TILE_CELLS * TILE_CELLS;

/// A tile's place: tile (0, 0) has its corner of lowest x and y at the origin of the map frame. It
/// is written as `X_Y`.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct TileIndex {
    pub x: i32,
    pub y: i32,
}

impl fmt::Display for TileIndex {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}_{}", self.x, self.y)
    }
}

impl TileIndex {
    pub fn corner(self) -> [i64; 2] {
        [self.x, self.y].map(|index| i64::from(index) * TILE_CELLS as i64)
    }

    /// Returns the tiles of the square that reaches `reach_m` to each side of `centre`, in rising
    /// order.
    pub fn around(
        centre: &Point2<f64>,
        reach_m: f64,
        cell_m: f64,
    ) -> impl Iterator<Item = Self> + use<> {
        let [columns, rows] = [centre.x, centre.y].map(|at| span(at, reach_m, cell_m));
        columns.flat_map(move |x| rows.clone().map(move |y| Self { x, y }))
    }
}

fn span(at_m: f64, reach_m: f64, cell_m: f64) -> RangeInclusive<i32> {
    let tile_m = cell_m * TILE_CELLS as f64;
    let tile = |at_m: f64| (at_m / tile_m).floor() as i32;
    tile(at_m - reach_m)..=tile(at_m + reach_m)
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Cell {
    /// The share of looks with returned power: the square root of that share, from 0 (never) to
    /// 255.
    pub evidence: u8,
    /// Number of looks, from 0 (never) to 255 (8 times from nearby, or oftener).
    pub looked: u8,
}

/// A cell is known if it was looked at half a time from nearby, and occupied if it returned a
/// sixteenth of the power it might have.
const KNOWN_LOOKED: u8 = 16;
const OCCUPIED_EVIDENCE: u8 = 64;

impl Cell {
    /// Returns the first value for a cell that was hardly looked at, the second for a free one, and
    /// the third for an occupied one.
    pub(crate) fn occupancy(self, [unknown, free, occupied]: [u8; 3]) -> u8 {
        match self {
            cell if cell.looked < KNOWN_LOOKED => unknown,
            cell if cell.evidence >= OCCUPIED_EVIDENCE => occupied,
            _ => free,
        }
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub struct TileImage {
    /// Row after row, from the highest y down; in each row the lowest x first.
    pub cells: Vec<Cell>,
}

impl Default for TileImage {
    fn default() -> Self {
        Self {
            cells: vec![Cell::default(); CELLS],
        }
    }
}

impl TileImage {
    pub fn rows(&self) -> impl DoubleEndedIterator<Item = &[Cell]> {
        self.cells.chunks_exact(TILE_CELLS)
    }
}

/// The smallest rectangle of tiles around all tiles of a map.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct TileExtent {
    pub min: TileIndex,
    pub max: TileIndex,
}

impl TileExtent {
    pub fn of(tiles: &[TileIndex]) -> Option<Self> {
        let first = *tiles.first()?;
        let around = |extent: Self, tile: &TileIndex| Self {
            min: TileIndex {
                x: extent.min.x.min(tile.x),
                y: extent.min.y.min(tile.y),
            },
            max: TileIndex {
                x: extent.max.x.max(tile.x),
                y: extent.max.y.max(tile.y),
            },
        };
        let start = Self {
            min: first,
            max: first,
        };
        Some(tiles.iter().fold(start, around))
    }

    pub fn cells(&self) -> [usize; 2] {
        let count = |min: i32, max: i32| (max.abs_diff(min) as usize + 1) * TILE_CELLS;
        [count(self.min.x, self.max.x), count(self.min.y, self.max.y)]
    }

    /// Returns the corner of lowest x and y in the map frame, m.
    pub fn corner_m(&self, cell_m: f64) -> Vector2<f64> {
        let [x, y] = self.min.corner();
        Vector2::new(x as f64, y as f64) * cell_m
    }
}
