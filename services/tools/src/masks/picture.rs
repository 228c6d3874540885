//! Pictures as PNG files.

use std::{fs, path::Path};

use gyre_configuration::terminal::Failure;
use gyre_slam::mapping::encode_png;
use gyre_storage::StorageError;
use png::ColorType;

pub fn write_grey(path: &Path, width: usize, pixels: &[u8]) -> Result<(), Failure> {
    let picture = encode_png(width, ColorType::Grayscale, pixels)?;
    Ok(fs::write(path, picture).map_err(StorageError::at("write", path))?)
}
