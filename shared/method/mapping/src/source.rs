//! Where the tiles of a map come from, and why they do not.

use std::path::PathBuf;

use gyre_storage::StorageError;
use thiserror::Error;

use crate::{Cell, Evidence, OptionError, TileImage, TileIndex, georeference::OriginError};

/// A map that cannot be drawn, written or read.
#[derive(Debug, Error)]
pub enum MapError {
    /// A file that cannot be read or written.
    #[error(transparent)]
    Storage(#[from] StorageError),
    /// An option that is out of bounds.
    #[error(transparent)]
    Option(#[from] OptionError),
    /// A place that is not on the earth, or beyond UTM.
    #[error(transparent)]
    Origin(#[from] OriginError),
    /// A folder that is not a map.
    #[error("{} is not a map: {reason}", path.display())]
    NotAMap {
        /// The folder.
        path: PathBuf,
        /// The problem.
        reason: String,
    },
    /// A tile that cannot be read.
    #[error("{}: {reason}; draw the map anew", path.display())]
    Tile {
        /// The file.
        path: PathBuf,
        /// The problem.
        reason: String,
    },
    /// No keyframe.
    #[error("the map is empty: no keyframe was drawn")]
    Empty,
    /// More cells than a picture can have.
    #[error(
        "the map has {columns} x {rows} cells, too many for {form}: choose larger cells, or the map's folder"
    )]
    TooLarge {
        /// Cells along x.
        columns: usize,
        /// Cells along y.
        rows: usize,
        /// The form.
        form: &'static str,
    },
    /// Pixels that cannot be encoded.
    #[error("cannot encode a picture: {0}")]
    Encode(String),
}

/// A map, tile by tile.
pub trait TileSource {
    /// The side of a cell, m.
    fn cell_m(&self) -> f64;

    /// The tiles in rising order.
    fn tiles(&self) -> Vec<TileIndex>;

    /// Reads a tile; one that does not exist is blank.
    fn read(&mut self, tile: TileIndex, image: &mut TileImage) -> Result<(), MapError>;
}

impl TileSource for Evidence {
    fn cell_m(&self) -> f64 {
        self.options().cell_m
    }

    fn tiles(&self) -> Vec<TileIndex> {
        Evidence::tiles(self)
    }

    fn read(&mut self, tile: TileIndex, image: &mut TileImage) -> Result<(), MapError> {
        if !self.image(tile, image)? {
            image.cells.fill(Cell::default());
        }
        Ok(())
    }
}
