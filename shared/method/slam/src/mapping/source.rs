//! Where the tiles of a map come from, and why they do not.

use std::path::PathBuf;

use gyre_storage::StorageError;
use thiserror::Error;

use crate::mapping::{OptionError, TileImage, TileIndex, georeference::OriginError};

#[derive(Debug, Error)]
pub enum MapError {
    #[error(transparent)]
    Storage(#[from] StorageError),
    #[error(transparent)]
    Option(#[from] OptionError),
    #[error(transparent)]
    Origin(#[from] OriginError),
    #[error("{} is not a map: {reason}", path.display())]
    NotAMap { path: PathBuf, reason: String },
    #[error("{}: {reason}; draw the map anew", path.display())]
    Tile { path: PathBuf, reason: String },
    #[error("the map is empty: no keyframe was drawn")]
    Empty,
    /// Cells along x and along y, and the form.
    #[error(
        "the map has {} x {} cells, too many for {}: choose larger cells, or the map's folder", .0[0], .0[1], .1
    )]
    TooLarge([usize; 2], &'static str),
    #[error("cannot encode a picture: {0}")]
    Encode(String),
}

pub trait TileSource {
    fn cell_m(&self) -> f64;

    fn tiles(&self) -> Vec<TileIndex>;

    /// Reads a tile; one that does not exist is blank.
    fn read(&mut self, tile: TileIndex, image: &mut TileImage) -> Result<(), MapError>;
}
