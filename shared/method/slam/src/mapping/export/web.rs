//! Web tiles: a pyramid of pictures as maps in browsers read them.

use std::path::Path;

use gyre_storage::{Draft, create_folder};
use png::ColorType;

use crate::mapping::{
    MapError, TILE_CELLS, TileExtent, TileImage, TileIndex, TileSource,
    pixels::{draw, encode, overlay},
};

/// The deepest pyramid: 30,000 km of tiles on a side.
const MAX_ZOOM: u32 = 20;

/// Writes `Z/X/Y.png` into `folder`, X to the right and Y down from the map's upper left corner,
/// and `tiles.json` with the data that a viewer needs. The deepest level has the map's own cells;
/// each level above half as many a side. Unknown places are transparent.
pub fn write_web_tiles(folder: &Path, source: &mut impl TileSource) -> Result<(), MapError> {
    let tiles = source.tiles();
    let extent = TileExtent::of(&tiles).ok_or(MapError::Empty)?;
    let [columns, rows] = extent.cells().map(|cells| cells / TILE_CELLS);
    let zoom = columns.max(rows).next_power_of_two().ilog2();
    if zoom > MAX_ZOOM {
        return Err(MapError::TooLarge(extent.cells(), "web tiles"));
    }
    let mut pyramid = Pyramid {
        folder,
        source,
        tiles: tiles.into_iter().collect(),
        extent,
        zoom,
    };
    pyramid.build(0, 0, 0)?;
    let cell_m = pyramid.source.cell_m();
    let top = extent.corner_m(cell_m).y + (rows * TILE_CELLS) as f64 * cell_m;
    let rounded = |metres: f64| (metres * 1e3).round() / 1e3;
    let json = serde_json::json!({
        "tiles": ["{z}/{x}/{y}.png"],
        "minzoom": 0,
        "maxzoom": zoom,
        "tile_size": TILE_CELLS,
        "left_m": rounded(extent.corner_m(cell_m).x),
        "top_m": rounded(top),
        "metres_per_pixel_at_maxzoom": cell_m,
    });
    let json = format!("{json:#}\n");
    Ok(gyre_storage::write(&folder.join("tiles.json"), json)?)
}

struct Pyramid<'a, S> {
    folder: &'a Path,
    source: &'a mut S,
    tiles: std::collections::BTreeSet<TileIndex>,
    extent: TileExtent,
    zoom: u32,
}

impl<S: TileSource> Pyramid<'_, S> {
    /// Writes a tile of a level and all below it; `None` where nothing is known.
    fn build(&mut self, zoom: u32, x: u32, y: u32) -> Result<Option<TileImage>, MapError> {
        let image = match zoom == self.zoom {
            true => self.deepest(x, y)?,
            false => self.united(zoom, x, y)?,
        };
        if let Some(image) = &image {
            let folder = self.folder.join(zoom.to_string()).join(x.to_string());
            create_folder(&folder)?;
            let pixels: Vec<[u8; 4]> = image.cells.iter().map(|cell| overlay(*cell)).collect();
            let mut draft = Draft::create(&folder.join(format!("{y}.png")))?;
            draft.append(encode(TILE_CELLS, ColorType::Rgba, pixels.as_flattened())?)?;
            draft.commit()?;
        }
        Ok(image)
    }

    fn deepest(&mut self, x: u32, y: u32) -> Result<Option<TileImage>, MapError> {
        let tile = TileIndex {
            x: self.extent.min.x + x as i32,
            y: self.extent.max.y - y as i32,
        };
        if !self.tiles.contains(&tile) {
            return Ok(None);
        }
        let mut image = TileImage::default();
        self.source.read(tile, &mut image)?;
        Ok(Some(image))
    }

    fn united(&mut self, zoom: u32, x: u32, y: u32) -> Result<Option<TileImage>, MapError> {
        let mut image = None;
        for (right, down) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            if let Some(part) = self.build(zoom + 1, 2 * x + right, 2 * y + down)? {
                let quarter = [right as usize, down as usize].map(|k| k * TILE_CELLS / 2);
                let whole: &mut TileImage = image.get_or_insert_default();
                draw(&part, 2, &mut whole.cells, TILE_CELLS, quarter);
            }
        }
        Ok(image)
    }
}
