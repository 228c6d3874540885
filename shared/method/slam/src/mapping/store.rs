//! The evidence of all tiles, with a limited number of tiles in memory.

use std::{
    collections::BTreeMap,
    fs::File,
    os::unix::fs::FileExt,
    path::{Path, PathBuf},
};

use gyre_storage::StorageError;

use crate::mapping::tile::{CELLS, TILE_CELLS, TileIndex};

/// Cells per side of a block: how often it was looked at varies slowly, and is kept for a block
/// rather than a cell.
pub const BLOCK: usize = 4;
pub const BLOCKS: usize = TILE_CELLS / BLOCK;
/// One look from nearby, and one return of full weight in it.
pub const ONE: u32 = 1 << 14;

/// The evidence about the cells of a tile, in units of [`ONE`].
/// Integers, so that a keyframe is taken out again without a trace, and sums do not depend on their
/// order.
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
pub struct Tile {
    /// The returns of each cell, row after row, from the lowest y up.
    pub returned: [u32; CELLS],
    pub looked: [u32; BLOCKS * BLOCKS],
}

#[derive(Default)]
struct Entry {
    keyframes: u32,
    used: u64,
    tile: Option<Box<Tile>>,
    /// The place in the file, once it has been written.
    slot: Option<u64>,
}

/// The tiles that keyframes look at. Those not used for longest lie in a file without a name, which
/// no kill leaves behind.
pub struct TileStore {
    entries: BTreeMap<TileIndex, Entry>,
    folder: PathBuf,
    file: Option<File>,
    /// Places in the file, and those that are free again.
    slots: u64,
    free: Vec<u64>,
    in_memory: usize,
    max_in_memory: usize,
    clock: u64,
}

impl TileStore {
    pub fn new(folder: &Path, max_in_memory: usize) -> Self {
        Self {
            entries: BTreeMap::new(),
            folder: folder.to_owned(),
            file: None,
            slots: 0,
            free: Vec::new(),
            in_memory: 0,
            max_in_memory,
            clock: 0,
        }
    }

    pub fn tiles(&self) -> impl Iterator<Item = TileIndex> {
        self.entries.keys().copied()
    }

    pub fn enter(&mut self, index: TileIndex) {
        self.entries.entry(index).or_default().keyframes += 1;
    }

    /// Counts one keyframe less. A tile without any is forgotten.
    pub fn leave(&mut self, index: TileIndex) {
        let Some(entry) = self.entries.get_mut(&index) else {
            return;
        };
        entry.keyframes -= 1;
        if entry.keyframes == 0 {
            self.in_memory -= usize::from(entry.tile.is_some());
            self.free.extend(entry.slot);
            self.entries.remove(&index);
        }
    }

    /// Returns a tile that a keyframe touches; `None` for any other tile.
    pub fn get(&mut self, index: TileIndex) -> Result<Option<&mut Tile>, StorageError> {
        self.clock += 1;
        let clock = self.clock;
        match self.entries.get(&index) {
            None => return Ok(None),
            Some(entry) if entry.tile.is_none() => self.load(index)?,
            Some(_) => (),
        }
        let entry = self.entries.get_mut(&index);
        Ok(entry.and_then(|entry| {
            entry.used = clock;
            entry.tile.as_deref_mut()
        }))
    }

    fn load(&mut self, index: TileIndex) -> Result<(), StorageError> {
        while self.in_memory >= self.max_in_memory {
            self.spill()?;
        }
        let failed = StorageError::at("read", &self.folder);
        let Some(entry) = self.entries.get_mut(&index) else {
            return Ok(());
        };
        let mut tile: Box<Tile> = bytemuck::zeroed_box();
        if let (Some(slot), Some(file)) = (entry.slot, &self.file) {
            let bytes = bytemuck::bytes_of_mut(tile.as_mut());
            file.read_exact_at(bytes, slot * size_of::<Tile>() as u64)
                .map_err(failed)?;
        }
        entry.tile = Some(tile);
        self.in_memory += 1;
        Ok(())
    }

    /// Writes the tile in memory that was not used for longest.
    fn spill(&mut self) -> Result<(), StorageError> {
        let failed = StorageError::at("write", &self.folder);
        let in_memory = self.entries.values_mut().filter(|e| e.tile.is_some());
        let Some(oldest) = in_memory.min_by_key(|entry| entry.used) else {
            return Ok(());
        };
        let file = match &mut self.file {
            Some(file) => file,
            none => none.insert(tempfile::tempfile_in(&self.folder).map_err(&failed)?),
        };
        let slot = oldest.slot.or_else(|| self.free.pop()).unwrap_or_else(|| {
            self.slots += 1;
            self.slots - 1
        });
        let tile = oldest.tile.take().unwrap_or_else(bytemuck::zeroed_box);
        file.write_all_at(
            bytemuck::bytes_of(tile.as_ref()),
            slot * size_of::<Tile>() as u64,
        )
        .map_err(&failed)?;
        oldest.slot = Some(slot);
        self.in_memory -= 1;
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn index(x: i32) -> TileIndex {
        TileIndex { x, y: -x }
    }

    #[test]
    fn tiles_beyond_the_memory_come_back_from_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let mut store = TileStore::new(folder.path(), 2);
        for round in 1..=3 {
            for x in 0..5 {
                store.enter(index(x));
                let tile = store.get(index(x)).unwrap().unwrap();
                assert_eq!(tile.returned[7], (round - 1) * (x as u32 + 1));
                tile.returned[7] += x as u32 + 1;
                assert!(store.in_memory <= 2);
            }
        }
        assert_eq!(store.slots, 5);
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 0);
    }

    #[test]
    fn a_tile_is_forgotten_when_its_last_keyframe_leaves() {
        let folder = tempfile::tempdir().unwrap();
        let mut store = TileStore::new(folder.path(), 1);
        for x in 0..3 {
            store.enter(index(x));
            store.get(index(x)).unwrap().unwrap().looked[0] = 9;
        }
        store.leave(index(0));
        assert!(store.get(index(0)).unwrap().is_none());
        store.enter(index(0));
        assert_eq!(store.get(index(0)).unwrap().unwrap().looked[0], 0);
        assert_eq!(store.tiles().count(), 3);
        store.get(index(1)).unwrap().unwrap();
        assert_eq!(store.slots, 3);
    }
}
