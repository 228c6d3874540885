use std::{collections::BTreeMap, path::Path};

use gyre_geometry::Pose;
use gyre_storage::StorageError;
use nalgebra::Point2;

use crate::{
    Keyframe,
    mapping::{
        MapError, MapOptions, OptionError, TileSource,
        store::{BLOCK, BLOCKS, ONE, TileStore},
        tile::{Cell, TILE_CELLS, TileImage, TileIndex},
        view::View,
    },
};

/// Tiles in memory: 70 MB. A keyframe touches 16 to 25 of them.
const IN_MEMORY: usize = 256;
/// A keyframe is drawn again when it moves a visible place by more than this share of a cell.
const MOVED_CELLS: f64 = 0.3;
/// Looks from nearby that reduce the evidence: a cell that was looked at once or twice is not yet
/// certain.
const PRIOR: f64 = 1.0;
/// Looks from nearby of a cell that is well known.
const WELL_KNOWN: f64 = 8.0;

/// The evidence of keyframes at their poses about the cells of a map, in whatever order they were
/// drawn. Memory: 70 MB of tiles, and a pose a keyframe; more tiles lie in a file without a name.
pub struct Evidence {
    options: MapOptions,
    view: View,
    store: TileStore,
    drawn: BTreeMap<u64, Pose>,
    /// The contribution of a keyframe to a tile: the cell and the amount.
    returned: BTreeMap<TileIndex, Vec<(u32, u32)>>,
}

#[derive(Clone, Copy, PartialEq)]
enum Change {
    Draw,
    Erase,
}

impl Change {
    /// Sums do not overflow for fewer looks at one cell than 200,000; an erased keyframe subtracts
    /// its earlier sum.
    fn apply(self, sum: &mut u32, amount: u32) {
        *sum = match self {
            Self::Draw => sum.wrapping_add(amount),
            Self::Erase => sum.wrapping_sub(amount),
        };
    }
}

impl Evidence {
    /// Starts without any. Tiles that do not fit into memory lie in a file in `folder`, which has
    /// no name and does not outlive the process.
    pub fn new(options: &MapOptions, folder: &Path) -> Result<Self, OptionError> {
        options.validate()?;
        Ok(Self {
            view: View::new(options),
            options: options.clone(),
            store: TileStore::new(folder, IN_MEMORY),
            drawn: BTreeMap::new(),
            returned: BTreeMap::new(),
        })
    }

    pub fn options(&self) -> &MapOptions {
        &self.options
    }

    pub fn keyframes(&self) -> usize {
        self.drawn.len()
    }

    /// Returns whether a keyframe at `pose` (in the map frame) should be drawn: it is not drawn
    /// yet, or its drawn pose displaces a visible point by more than 0.3 cells.
    pub fn has_moved(&self, seq: u64, pose: &Pose) -> bool {
        let limit_m = MOVED_CELLS * self.options.cell_m;
        self.drawn.get(&seq).is_none_or(|drawn| {
            let by = drawn.inv_mul(pose);
            let turned_m = by.rotation.angle().abs() * self.options.reach_m;
            by.translation.vector.norm() + turned_m > limit_m
        })
    }

    /// Draws a keyframe at `pose` in the map frame. If it is drawn already, it is taken out there
    /// first.
    pub fn draw(&mut self, keyframe: &Keyframe, pose: &Pose) -> Result<(), StorageError> {
        self.view.take(keyframe);
        if let Some(drawn) = self.drawn.insert(keyframe.seq, *pose) {
            self.change(&drawn, Change::Erase)?;
        }
        self.change(pose, Change::Draw)
    }

    fn change(&mut self, pose: &Pose, change: Change) -> Result<(), StorageError> {
        let centre = Point2::from(pose.translation.vector);
        let options = &self.options;
        let tiles = TileIndex::around(&centre, options.reach_m, options.cell_m);
        let tiles: Vec<TileIndex> = tiles.collect();
        self.collect_returns(&tiles, pose);
        let map_to_keyframe = pose.inverse();
        for &index in &tiles {
            if change == Change::Draw {
                self.store.enter(index);
            }
            if let Some(tile) = self.store.get(index)? {
                for &(cell, amount) in &self.returned[&index] {
                    change.apply(&mut tile.returned[cell as usize], amount);
                }
                let look = |place: Point2<f64>| self.view.look(&(map_to_keyframe * place).coords);
                let [x, y] = index.corner();
                let middle_m = |corner: i64, block: usize| {
                    (corner as f64 + (block as f64 + 0.5) * BLOCK as f64) * self.options.cell_m
                };
                for (row, looked) in tile.looked.chunks_exact_mut(BLOCKS).enumerate() {
                    for (column, looked) in looked.iter_mut().enumerate() {
                        let look = look(Point2::new(middle_m(x, column), middle_m(y, row)));
                        change.apply(looked, (look * f64::from(ONE)).round() as u32);
                    }
                }
            }
            if change == Change::Erase {
                self.store.leave(index);
            }
        }
        Ok(())
    }

    /// Shares each part of a return bilinearly between four cells.
    fn collect_returns(&mut self, tiles: &[TileIndex], pose: &Pose) {
        self.returned.retain(|tile, _| tiles.contains(tile));
        for tile in tiles {
            self.returned.entry(*tile).or_default().clear();
        }
        let (per_m, returned) = (1.0 / self.options.cell_m, &mut self.returned);
        self.view.returns(|place, amount| {
            let place = pose * place * per_m;
            let corner = place.map(|at| (at - 0.5).floor());
            let over = place.map(|at| at - 0.5) - corner;
            for (x, y) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
                let share = |far: i32, over: f64| if far == 1 { over } else { 1.0 - over };
                let amount = amount * share(x, over.x) * share(y, over.y);
                let (tile, cell) = locate(
                    corner.x as i64 + i64::from(x),
                    corner.y as i64 + i64::from(y),
                );
                // A part on the rim may lie in a tile that is not looked at.
                if let Some(cells) = returned.get_mut(&tile) {
                    cells.push((cell, (amount * f64::from(ONE)).round() as u32));
                }
            }
        });
    }
}

impl TileSource for Evidence {
    fn cell_m(&self) -> f64 {
        self.options.cell_m
    }

    fn tiles(&self) -> Vec<TileIndex> {
        self.store.tiles().collect()
    }

    fn read(&mut self, index: TileIndex, image: &mut TileImage) -> Result<(), MapError> {
        let Some(tile) = self.store.get(index)? else {
            image.cells.fill(Cell::default());
            return Ok(());
        };
        for (row, cells) in image.cells.chunks_exact_mut(TILE_CELLS).rev().enumerate() {
            for (column, cell) in cells.iter_mut().enumerate() {
                let looked = tile.looked[(row / BLOCK) * BLOCKS + column / BLOCK];
                *cell = quantise(tile.returned[row * TILE_CELLS + column], looked);
            }
        }
        Ok(())
    }
}

fn locate(x: i64, y: i64) -> (TileIndex, u32) {
    let side = TILE_CELLS as i64;
    let tile = TileIndex {
        x: x.div_euclid(side) as i32,
        y: y.div_euclid(side) as i32,
    };
    let cell = y.rem_euclid(side) * side + x.rem_euclid(side);
    (tile, cell as u32)
}

fn quantise(returned: u32, looked: u32) -> Cell {
    let [returned, looked] = [returned, looked].map(|sum| f64::from(sum) / f64::from(ONE));
    let share = (returned / (looked + PRIOR)).min(1.0);
    Cell {
        evidence: (255.0 * share.sqrt()).round() as u8,
        looked: (255.0 * (looked / WELL_KNOWN).min(1.0)).round() as u8,
    }
}
