//! A map row of tiles by row of tiles, for forms that are one large picture.

use crate::mapping::{Cell, MapError, TILE_CELLS, TileExtent, TileImage, TileIndex, TileSource};

/// Cells of one picture: 21 square kilometres of cells of 0.2 m, half a gigabyte in memory.
const MAX_CELLS: usize = 1 << 29;

pub fn extent(source: &impl TileSource, form: &'static str) -> Result<TileExtent, MapError> {
    let extent = TileExtent::of(&source.tiles()).ok_or(MapError::Empty)?;
    let [columns, rows] = extent.cells();
    match columns * rows <= MAX_CELLS {
        true => Ok(extent),
        false => Err(MapError::TooLarge([columns, rows], form)),
    }
}

/// Calls `take` with the cells of each row of tiles, from the highest y down, as rows of the whole
/// width.
pub fn for_each(
    source: &mut impl TileSource,
    extent: &TileExtent,
    mut take: impl FnMut(&[Cell]) -> Result<(), MapError>,
) -> Result<(), MapError> {
    let [width, _] = extent.cells();
    let mut strip = vec![Cell::default(); width * TILE_CELLS];
    let mut image = TileImage::default();
    for y in (extent.min.y..=extent.max.y).rev() {
        for (x, first) in (extent.min.x..=extent.max.x).zip((0..).step_by(TILE_CELLS)) {
            source.read(TileIndex { x, y }, &mut image)?;
            for (row, cells) in strip.chunks_exact_mut(width).zip(image.rows()) {
                row[first..first + TILE_CELLS].copy_from_slice(cells);
            }
        }
        take(&strip)?;
    }
    Ok(())
}
