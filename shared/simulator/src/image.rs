use std::path::Path;

use gyre_datasets::ImageSize;
use gyre_storage::Draft;

use crate::error::SimulatorError;

/// Encodes the 8-bit grey PNG of `path` to `into`, whose content is replaced. Fast rather than
/// small: the difference to the neighbour in range compresses better than PNG's other filters and
/// needs no trial for each row (4 ms for an Oxford scan, which halves in size).
pub(crate) fn encode(
    path: &Path,
    size: ImageSize,
    pixels: &[u8],
    into: &mut Vec<u8>,
) -> Result<(), SimulatorError> {
    into.clear();
    let mut encoder = png::Encoder::new(into, size.width as u32, size.height as u32);
    encoder.set_color(png::ColorType::Grayscale);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_compression(png::Compression::Fastest);
    // In transposed images range runs downwards.
    encoder.set_filter(if size.height > size.width {
        png::Filter::Up
    } else {
        png::Filter::Sub
    });
    let encoded = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(pixels)?;
        writer.finish()
    });
    encoded.map_err(|error| {
        SimulatorError::Refused(format!("cannot encode {}: {error}", path.display()))
    })
}

/// Writes an image as a whole or not at all, whatever ends the process or the machine; `buffer` is
/// working memory.
pub(crate) fn write_image(
    path: &Path,
    size: ImageSize,
    pixels: &[u8],
    buffer: &mut Vec<u8>,
) -> Result<(), SimulatorError> {
    encode(path, size, pixels, buffer)?;
    let mut draft = Draft::create(path)?;
    draft.append(buffer)?;
    Ok(draft.commit()?)
}
