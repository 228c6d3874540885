//! Pictures as PNG files.

use std::{fs, path::Path};

use gyre_mapping::encode_png;
use gyre_terminal::Failure;
use png::ColorType;

pub fn write_grey(path: &Path, width: usize, pixels: &[u8]) -> Result<(), Failure> {
    write(path, encode_png(width, ColorType::Grayscale, pixels)?)
}

pub fn write_rgb(path: &Path, width: usize, pixels: &[[u8; 3]]) -> Result<(), Failure> {
    write(
        path,
        encode_png(width, ColorType::Rgb, pixels.as_flattened())?,
    )
}

fn write(path: &Path, picture: Vec<u8>) -> Result<(), Failure> {
    let failed = |error| format!("cannot write the picture {}: {error}", path.display());
    Ok(fs::write(path, picture).map_err(failed)?)
}
