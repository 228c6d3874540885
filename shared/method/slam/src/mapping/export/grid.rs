//! A map as an occupancy grid, with the values of ROS.

use crate::mapping::{MapError, TILE_CELLS, TileExtent, TileImage, TileSource};
use nalgebra::Vector2;

/// The most cells of a grid. What sends it is slow with larger messages.
const MAX_CELLS: usize = 1 << 20;
/// Values of a cell: percent, and the byte of -1.
const FREE: u8 = 0;
const OCCUPIED: u8 = 100;
const UNKNOWN: u8 = u8::MAX;

/// An occupancy grid in the frame of the map's tiles.
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    pub cell_m: f64,
    pub columns: usize,
    pub rows: usize,
    pub corner_m: Vector2<f64>,
    /// The cells by rows, from the corner on: 0 to 100 % occupied, 255 unknown.
    pub values: Vec<u8>,
}

/// Returns a map as a grid in the frame of its tiles: the grid has no rotation, since Nav2 ignores
/// it. Blocks of 2 x 2, 4 x 4 and so on become one cell if the grid would have more than a million
/// cells: occupied if one of them is occupied, free if one is free and no other is occupied.
pub fn grid(source: &mut impl TileSource) -> Result<Grid, MapError> {
    let extent = TileExtent::of(&source.tiles()).ok_or(MapError::Empty)?;
    let block = block(extent);
    let [width, height] = extent.cells().map(|cells| cells / block);
    let mut data = vec![UNKNOWN; width * height];
    let mut image = TileImage::default();
    for tile in source.tiles() {
        source.read(tile, &mut image)?;
        let [column, row] = [tile.x.abs_diff(extent.min.x), tile.y.abs_diff(extent.min.y)]
            .map(|tiles| tiles as usize * TILE_CELLS / block);
        // A grid begins with the lowest y, a tile with the highest.
        for (row, cells) in (0..).map(|at| row + at / block).zip(image.rows().rev()) {
            let line = &mut data[row * width..][..width];
            for (column, cell) in (0..).map(|at| column + at / block).zip(cells) {
                line[column] = unite(line[column], cell.occupancy([UNKNOWN, FREE, OCCUPIED]));
            }
        }
    }
    let cell_m = source.cell_m();
    Ok(Grid {
        cell_m: cell_m * block as f64,
        columns: width,
        rows: height,
        corner_m: extent.corner_m(cell_m),
        values: data,
    })
}

/// The side of the blocks of cells, a power of two, at most the side of a tile.
fn block(extent: TileExtent) -> usize {
    let [columns, rows] = extent.cells();
    let mut block = 1;
    while block < TILE_CELLS && (columns / block) * (rows / block) > MAX_CELLS {
        block *= 2;
    }
    block
}

/// One of two cells in a block: occupied before free before unknown.
fn unite(one: u8, other: u8) -> u8 {
    match (one, other) {
        (UNKNOWN, known) | (known, UNKNOWN) => known,
        (one, other) => one.max(other),
    }
}

#[cfg(test)]
mod tests {
    use crate::mapping::{Cell, TileIndex};

    use super::*;

    /// A wall at the lowest x and y of each of `tiles`, and free ground beside it.
    struct Walls(Vec<TileIndex>);

    impl TileSource for Walls {
        fn cell_m(&self) -> f64 {
            0.5
        }

        fn tiles(&self) -> Vec<TileIndex> {
            self.0.clone()
        }

        fn read(&mut self, _: TileIndex, image: &mut TileImage) -> Result<(), MapError> {
            image.cells.fill(Cell::default());
            let (last_row, looked) = (TILE_CELLS * (TILE_CELLS - 1), 255);
            let cells = [255, 0].map(|evidence| Cell { evidence, looked });
            image.cells[last_row..last_row + 2].copy_from_slice(&cells);
            Ok(())
        }
    }

    fn tile(x: i32, y: i32) -> TileIndex {
        TileIndex { x, y }
    }

    #[test]
    fn the_first_cell_is_that_of_lowest_x_and_y() {
        let grid = grid(&mut Walls(vec![tile(-1, 0), tile(0, 2)])).unwrap();
        assert_eq!((grid.columns, grid.rows), (512, 768));
        assert_eq!(grid.cell_m, 0.5);
        assert_eq!(grid.corner_m, Vector2::new(-128.0, 0.0));
        assert_eq!(grid.values[..3], [OCCUPIED, FREE, UNKNOWN]);
        let second = 2 * 256 * 512 + 256;
        assert_eq!(grid.values[second..second + 3], [OCCUPIED, FREE, UNKNOWN]);
        let known = grid.values.iter().filter(|cell| **cell != UNKNOWN);
        assert_eq!(known.count(), 4);
    }

    #[test]
    fn a_large_map_has_larger_cells() {
        let grid = grid(&mut Walls(vec![tile(0, 0), tile(9, 9)])).unwrap();
        assert_eq!((grid.columns, grid.rows), (640, 640));
        assert_eq!(grid.cell_m, 2.0);
        assert_eq!(grid.values[..2], [OCCUPIED, UNKNOWN]);
    }
}
