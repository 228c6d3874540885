//! The cells of a picture: a map at a size fit for viewing, cropped to its seen part.

use crate::mapping::{
    Cell, MapError, TILE_CELLS, TileExtent, TileImage, TileIndex, TileSource, pixels,
};
use nalgebra::Vector2;

const MAX_SIDE: usize = 4096;
/// Least opacity of a seen cell: one look from nearby.
const SEEN: u8 = 32;

/// The cells of a picture, row after row, from the highest y down.
pub struct Ground {
    pub width: usize,
    pub cells: Vec<Cell>,
    /// Place of the upper left corner in the map frame, m.
    pub corner_m: Vector2<f64>,
    pub pixel_m: f64,
}

impl Ground {
    pub fn read(source: &mut impl TileSource, extent: &TileExtent) -> Result<Self, MapError> {
        let [columns, rows] = extent.cells();
        // A power of two, so that a tile has a whole number of blocks.
        let block = columns.max(rows).div_ceil(MAX_SIDE).next_power_of_two();
        if block > TILE_CELLS {
            return Err(MapError::TooLarge([columns, rows], "a picture"));
        }
        let (width, side) = (columns / block, TILE_CELLS / block);
        let mut cells = vec![Cell::default(); width * (rows / block)];
        let mut image = TileImage::default();
        for tile in source.tiles() {
            source.read(tile, &mut image)?;
            let left = tile.x.abs_diff(extent.min.x) as usize * side;
            let top = tile.y.abs_diff(extent.max.y) as usize * side;
            pixels::draw(&image, block, &mut cells, width, [left, top]);
        }
        let cell_m = source.cell_m();
        let above = TileIndex {
            x: extent.min.x,
            y: extent.max.y + 1,
        };
        let [x, y] = above.corner();
        let ground = Self {
            width,
            cells,
            corner_m: Vector2::new(x as f64, y as f64) * cell_m,
            pixel_m: cell_m * block as f64,
        };
        Ok(ground.cropped())
    }

    pub fn height(&self) -> usize {
        self.cells.len() / self.width
    }

    fn cropped(self) -> Self {
        let is_seen = |cell: &Cell| cell.looked >= SEEN;
        let rows = || self.cells.chunks_exact(self.width);
        let top = rows().position(|row| row.iter().any(is_seen));
        let bottom = rows().rposition(|row| row.iter().any(is_seen));
        let left = rows().filter_map(|row| row.iter().position(is_seen)).min();
        let right = rows().filter_map(|row| row.iter().rposition(is_seen)).max();
        let (Some(top), Some(bottom), Some(left), Some(right)) = (top, bottom, left, right) else {
            return self;
        };
        let kept = rows().take(bottom + 1).skip(top);
        let cells = kept.flat_map(|row| &row[left..=right]).copied().collect();
        Self {
            width: right + 1 - left,
            cells,
            corner_m: self.corner_m + Vector2::new(left as f64, -(top as f64)) * self.pixel_m,
            pixel_m: self.pixel_m,
        }
    }
}
