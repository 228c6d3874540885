//! Scans as images.

use std::fs::File;
use std::io::{BufWriter, Write as _};
use std::path::Path;

use crate::SimulatorError;

/// An 8-bit grey PNG, compressed fast rather than well.
pub(crate) fn write_image(path: &Path, width: usize, height: usize, pixels: &[u8]) -> Result<(), SimulatorError> {
    let encoding = |source| SimulatorError::Encode { path: path.to_owned(), source };
    let file = File::create(path).map_err(SimulatorError::write(path))?;
    let mut buffer = BufWriter::new(file);
    let mut encoder = png::Encoder::new(&mut buffer, width as u32, height as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fast);
    let mut writer = encoder.write_header().map_err(encoding)?;
    writer.write_image_data(pixels).map_err(encoding)?;
    writer.finish().map_err(encoding)?;
    buffer.flush().map_err(SimulatorError::write(path))
}
