//! Scans as images, and files that are there as a whole or not at all.

use std::fs;
use std::path::Path;

use gyre_radar::ImageSize;

use crate::error::SimulatorError;

/// Extension of files that are not complete yet.
pub(crate) const PART: &str = "part";

/// Encodes an 8-bit grey PNG to `into`, whose content is replaced. Fast rather than small: the difference to the neighbour in range
/// packs better than any other that a PNG knows, and needs no trying row by row (4 ms for an Oxford scan, which halves).
pub(crate) fn encode(
    size: ImageSize,
    pixels: &[u8],
    into: &mut Vec<u8>,
) -> Result<(), png::EncodingError> {
    into.clear();
    let mut encoder = png::Encoder::new(into, size.width as u32, size.height as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fastest);
    // In images on their side range runs downwards.
    encoder.set_filter(if size.height > size.width {
        png::Filter::Up
    } else {
        png::Filter::Sub
    });
    let mut writer = encoder.write_header()?;
    writer.write_image_data(pixels)?;
    writer.finish()
}

/// Writes an image as a whole or not at all; `buffer` is working memory.
pub(crate) fn write_image(
    path: &Path,
    size: ImageSize,
    pixels: &[u8],
    buffer: &mut Vec<u8>,
) -> Result<(), SimulatorError> {
    encode(size, pixels, buffer).map_err(|source| SimulatorError::Encode {
        path: path.to_owned(),
        source,
    })?;
    write_whole(path, buffer)
}

/// Writes a file under another name and renames it: whoever is killed meanwhile leaves no half of it. (A power failure may.)
pub(crate) fn write_whole(path: &Path, bytes: &[u8]) -> Result<(), SimulatorError> {
    let part = path.with_extension(PART);
    fs::write(&part, bytes).map_err(SimulatorError::write(&part))?;
    fs::rename(&part, path).map_err(SimulatorError::write(path))
}
