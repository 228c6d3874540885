use std::{
    collections::BTreeSet,
    fs,
    io::Cursor,
    path::{Path, PathBuf},
};

use gyre_storage::{self as storage, StorageError};
use png::{BitDepth, ColorType};
use serde::{Deserialize, Serialize};

use crate::mapping::{
    Cell, Evidence, MapError, MapOptions, Origin, TILE_CELLS, TileImage, TileIndex, TileSource,
    pixels,
};

const VERSION: i64 = 1;
const MANIFEST: &str = "map.toml";
const TILES: &str = "tiles";
const FRAME: &str =
    "x forward and y left at the first keyframe, m; tile X_Y begins at (X, Y) times its side";
/// A tile of noise has 150 kB.
const MAX_TILE_BYTES: u64 = 1 << 20;
/// Tiles of a map: 7,000 km of streets.
const MAX_TILES: usize = 500_000;

#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Manifest {
    version: i64,
    made_by: String,
    frame: String,
    tile_cells: usize,
    keyframes: usize,
    tiles: Vec<[i32; 2]>,
    options: MapOptions,
    origin: Option<Origin>,
}

#[derive(Debug)]
pub struct Map {
    folder: PathBuf,
    manifest: Manifest,
    tiles: BTreeSet<TileIndex>,
}

/// Writes a map into `folder`: `tiles/X_Y.png` (grey: evidence, opacity: how often it was looked
/// at; see [`Cell`]), then `map.toml`, without which the folder is not a map. A map that is there
/// is replaced. It survives a power failure when this returns.
pub fn write_map(
    folder: &Path,
    evidence: &mut Evidence,
    origin: Option<Origin>,
    made_by: &str,
) -> Result<(), MapError> {
    let tiles = evidence.tiles();
    if tiles.is_empty() {
        return Err(MapError::Empty);
    }
    clear(folder)?;
    storage::create_folder(&folder.join(TILES))?;
    let mut image = TileImage::default();
    for &tile in &tiles {
        evidence.read(tile, &mut image)?;
        let pixels = bytemuck::cast_slice(&image.cells);
        let mut draft = storage::Draft::create(&tile_path(folder, tile))?;
        draft.append(pixels::encode(
            TILE_CELLS,
            ColorType::GrayscaleAlpha,
            pixels,
        )?)?;
        draft.commit()?;
    }
    storage::sync_folder(&folder.join(TILES))?;
    let manifest = Manifest {
        version: VERSION,
        made_by: made_by.to_owned(),
        frame: FRAME.to_owned(),
        tile_cells: TILE_CELLS,
        keyframes: evidence.keyframes(),
        tiles: tiles.iter().map(|tile| [tile.x, tile.y]).collect(),
        options: evidence.options().clone(),
        origin,
    };
    let text = toml::to_string(&manifest).map_err(|error| MapError::Encode(error.to_string()))?;
    Ok(storage::write(&folder.join(MANIFEST), text)?)
}

fn clear(folder: &Path) -> Result<(), MapError> {
    let tiles = tiles_in(folder)?;
    if tiles.is_empty() {
        return Ok(());
    }
    storage::remove(&folder.join(MANIFEST))?;
    storage::sync_folder(folder)?;
    Ok(tiles.iter().try_for_each(|tile| storage::remove(tile))?)
}

/// Checks that a folder has no tiles, or only such as a map has: that a map may be written there.
pub fn require_tiles_only(folder: &Path) -> Result<(), MapError> {
    tiles_in(folder).map(drop)
}

fn tiles_in(folder: &Path) -> Result<Vec<PathBuf>, MapError> {
    let tiles = folder.join(TILES);
    if !tiles.exists() {
        return Ok(Vec::new());
    }
    let failed = StorageError::at("read", &tiles);
    let mut paths = Vec::new();
    for entry in fs::read_dir(&tiles).map_err(&failed)? {
        let path = entry.map_err(&failed)?.path();
        let is_ours = path.extension().is_some_and(|end| end == "png") || storage::is_draft(&path);
        if !is_ours {
            return Err(MapError::NotAMap {
                path: folder.to_owned(),
                reason: format!("{} is no tile; choose another folder", path.display()),
            });
        }
        paths.push(path);
    }
    Ok(paths)
}

fn tile_path(folder: &Path, tile: TileIndex) -> PathBuf {
    folder.join(TILES).join(format!("{tile}.png"))
}

impl Map {
    pub fn open(folder: &Path) -> Result<Self, MapError> {
        let refused = |reason: String| MapError::NotAMap {
            path: folder.to_owned(),
            reason,
        };
        let path = folder.join(MANIFEST);
        if !path.exists() {
            let reason = "it has no map.toml; gyre map writes that last, so a map that was interrupted has none";
            return Err(refused(reason.to_owned()));
        }
        let text = storage::read_text(&path, storage::SETTINGS)
            .map_err(StorageError::at("read", &path))?;
        let unreadable = |error: toml::de::Error| refused(format!("map.toml: {}", error.message()));
        let table: toml::Table = toml::from_str(&text).map_err(unreadable)?;
        // Other versions of this program write the version in the same form.
        let Some(version) = table.get("version").and_then(toml::Value::as_integer) else {
            return Err(refused("map.toml has no version".to_owned()));
        };
        if version != VERSION {
            return Err(refused(format!(
                "its version is {version}, and this program reads version {VERSION}: use the gyre that drew it, or draw it again with gyre map"
            )));
        }
        let manifest: Manifest = toml::Value::Table(table).try_into().map_err(unreadable)?;
        manifest.options.validate()?;
        if manifest.tile_cells != TILE_CELLS || manifest.tiles.len() > MAX_TILES {
            return Err(refused(format!(
                "it has {} tiles of {} cells a side; {MAX_TILES} tiles of {TILE_CELLS} are the most",
                manifest.tiles.len(),
                manifest.tile_cells
            )));
        }
        let tiles = manifest.tiles.iter().map(|&[x, y]| TileIndex { x, y });
        Ok(Self {
            folder: folder.to_owned(),
            tiles: tiles.collect(),
            manifest,
        })
    }

    pub fn options(&self) -> &MapOptions {
        &self.manifest.options
    }

    pub fn origin(&self) -> Option<Origin> {
        self.manifest.origin
    }

    pub fn keyframes(&self) -> usize {
        self.manifest.keyframes
    }
}

impl TileSource for Map {
    fn cell_m(&self) -> f64 {
        self.manifest.options.cell_m
    }

    fn tiles(&self) -> Vec<TileIndex> {
        self.tiles.iter().copied().collect()
    }

    fn read(&mut self, tile: TileIndex, image: &mut TileImage) -> Result<(), MapError> {
        image.cells.fill(Cell::default());
        if !self.tiles.contains(&tile) {
            return Ok(());
        }
        let path = tile_path(&self.folder, tile);
        let bytes =
            storage::read_bytes(&path, MAX_TILE_BYTES).map_err(StorageError::at("read", &path))?;
        decode(&bytes, image).map_err(|reason| MapError::Tile { path, reason })
    }
}

fn decode(bytes: &[u8], image: &mut TileImage) -> Result<(), String> {
    let damaged = |error: png::DecodingError| format!("the tile is damaged: {error}");
    let mut reader = png::Decoder::new(Cursor::new(bytes))
        .read_info()
        .map_err(damaged)?;
    let info = reader.info();
    let form = (info.width, info.height, info.color_type, info.bit_depth);
    let side = TILE_CELLS as u32;
    if form != (side, side, ColorType::GrayscaleAlpha, BitDepth::Eight) {
        return Err(format!(
            "a tile is {side} x {side} cells, grey with opacity, 8 bits each"
        ));
    }
    let pixels = bytemuck::cast_slice_mut(&mut image.cells);
    reader.next_frame(pixels).map_err(damaged)?;
    Ok(())
}
