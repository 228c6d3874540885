//! Pictures as PNG files.

use std::{fs::File, io::BufWriter, path::Path};

use thiserror::Error;

/// Why a picture was not written.
#[derive(Debug, Error)]
#[error("cannot write the picture {path}: {source}", path = path.display())]
pub struct PictureError {
    path: std::path::PathBuf,
    source: png::EncodingError,
}

/// Writes rows of grey values as PNG.
pub fn write_grey(path: &Path, width: usize, pixels: &[u8]) -> Result<(), PictureError> {
    encode(path, width, png::ColorType::Grayscale, pixels)
}

/// Writes rows of red, green and blue as PNG.
pub fn write_rgb(path: &Path, width: usize, pixels: &[[u8; 3]]) -> Result<(), PictureError> {
    encode(path, width, png::ColorType::Rgb, pixels.as_flattened())
}

fn encode(
    path: &Path,
    width: usize,
    color: png::ColorType,
    bytes: &[u8],
) -> Result<(), PictureError> {
    let height = bytes.len() / (width * color.samples()).max(1);
    let written = || {
        let file = BufWriter::new(File::create(path)?);
        let mut encoder = png::Encoder::new(file, width as u32, height as u32);
        encoder.set_color(color);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(bytes)?;
        writer.finish()
    };
    written().map_err(|source| PictureError {
        path: path.to_owned(),
        source,
    })
}
