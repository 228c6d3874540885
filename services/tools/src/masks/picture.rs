//! Pictures as PNG files.

use std::{fs::File, io::BufWriter, path::Path};

use gyre_terminal::Failure;

pub fn write_grey(path: &Path, width: usize, pixels: &[u8]) -> Result<(), Failure> {
    encode(path, width, png::ColorType::Grayscale, pixels)
}

pub fn write_rgb(path: &Path, width: usize, pixels: &[[u8; 3]]) -> Result<(), Failure> {
    encode(path, width, png::ColorType::Rgb, pixels.as_flattened())
}

fn encode(path: &Path, width: usize, color: png::ColorType, bytes: &[u8]) -> Result<(), Failure> {
    let height = bytes.len() / (width * color.samples()).max(1);
    let written = || -> Result<(), png::EncodingError> {
        let file = BufWriter::new(File::create(path)?);
        let mut encoder = png::Encoder::new(file, width as u32, height as u32);
        encoder.set_color(color);
        encoder.set_depth(png::BitDepth::Eight);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(bytes)?;
        writer.finish()
    };
    let failed = |error| format!("cannot write the picture {}: {error}", path.display());
    Ok(written().map_err(failed)?)
}
