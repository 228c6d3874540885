//! Pixels in PNG files, and fewer of them.

use png::{BitDepth, ColorType};

use crate::mapping::{Cell, MapError, TILE_CELLS, TileImage};

/// Encodes rows of pixels of 8 bits a channel.
pub fn encode(width: usize, color: ColorType, pixels: &[u8]) -> Result<Vec<u8>, MapError> {
    let height = pixels.len() / (width * color.samples()).max(1);
    let mut bytes = Vec::new();
    let mut encode = || -> Result<(), png::EncodingError> {
        let mut encoder = png::Encoder::new(&mut bytes, width as u32, height as u32);
        encoder.set_color(color);
        encoder.set_depth(BitDepth::Eight);
        let mut writer = encoder.write_header()?;
        writer.write_image_data(pixels)?;
        writer.finish()
    };
    encode().map_err(|error| MapError::Encode(error.to_string()))?;
    Ok(bytes)
}

/// Draws a tile with one pixel for each block of cells, into rows of `width` pixels from
/// `[left, top]` on.
pub fn draw(
    image: &TileImage,
    block: usize,
    pixels: &mut [Cell],
    width: usize,
    [left, top]: [usize; 2],
) {
    let side = TILE_CELLS / block;
    for row in 0..side {
        let first = (top + row) * width + left;
        for (column, pixel) in pixels[first..first + side].iter_mut().enumerate() {
            let first = row * block * TILE_CELLS + column * block;
            let cells = (0..block).flat_map(|k| &image.cells[first + k * TILE_CELLS..][..block]);
            *pixel = match block {
                // Most pictures have a pixel for each cell.
                1 => image.cells[first],
                _ => unite(cells.copied()),
            };
        }
    }
}

/// Unites a block of cells: evidence half way between the mean and the highest, so that thin walls
/// stay visible, and the mean look.
fn unite(cells: impl Iterator<Item = Cell> + Clone) -> Cell {
    let count = cells.clone().count().max(1) as u32;
    let sum = |value: fn(Cell) -> u8| {
        cells
            .clone()
            .map(|cell| u32::from(value(cell)))
            .sum::<u32>()
    };
    let highest = cells.clone().map(|cell| u32::from(cell.evidence)).max();
    let evidence = (sum(|cell| cell.evidence) / count + highest.unwrap_or(0)).div_ceil(2);
    Cell {
        evidence: evidence as u8,
        looked: (sum(|cell| cell.looked) / count) as u8,
    }
}

const UNKNOWN: [f32; 3] = [17.0, 20.0, 26.0];
const FREE: [f32; 3] = [34.0, 41.0, 54.0];
const WEAK: [f32; 3] = [176.0, 106.0, 44.0];
const STRONG: [f32; 3] = [255.0, 236.0, 190.0];
/// Evidence that is drawn as weak, and as strong. One cell in a hundred is stronger.
const WEAK_EVIDENCE: f32 = 45.0;
const STRONG_EVIDENCE: f32 = 100.0;

/// Steps of evidence and of looks that are invisible to the eye: a picture without them is half as
/// large.
const EVIDENCE_STEP: u8 = 4;
const LOOKED_STEP: u8 = 15;

/// Returns the colour of a cell that was well looked at.
fn seen(evidence: u8) -> [f32; 3] {
    let evidence = f32::from(stepped(evidence, EVIDENCE_STEP));
    match evidence < WEAK_EVIDENCE {
        true => blend(FREE, WEAK, evidence / WEAK_EVIDENCE),
        false => {
            let beyond = (evidence - WEAK_EVIDENCE) / (STRONG_EVIDENCE - WEAK_EVIDENCE);
            blend(WEAK, STRONG, beyond.min(1.0))
        }
    }
}

fn stepped(value: u8, step: u8) -> u8 {
    value / step * step
}

fn blend(from: [f32; 3], to: [f32; 3], share: f32) -> [f32; 3] {
    [0, 1, 2].map(|k| from[k] + (to[k] - from[k]) * share)
}

/// Returns the colour of a cell on the ground of a picture: red, green, blue.
pub fn colour(cell: Cell) -> [u8; 3] {
    let share = f32::from(stepped(cell.looked, LOOKED_STEP)) / 255.0;
    blend(UNKNOWN, seen(cell.evidence), share).map(|channel| channel.round() as u8)
}

/// Returns the colour of a cell over whatever lies below: red, green, blue, and opacity.
pub fn overlay(cell: Cell) -> [u8; 4] {
    let [red, green, blue] = seen(cell.evidence).map(|channel| channel.round() as u8);
    [red, green, blue, cell.looked]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_thin_wall_stays_visible_in_a_block() {
        let cell = |evidence| Cell {
            evidence,
            looked: 200,
        };
        let block = [cell(100), cell(0), cell(100), cell(0)];
        assert_eq!(unite(block.into_iter()), cell(75));
    }

    #[test]
    fn what_was_never_looked_at_is_ground() {
        assert_eq!(colour(Cell::default()), [17, 20, 26]);
        assert_eq!(overlay(Cell::default())[3], 0);
        let strong = Cell {
            evidence: 255,
            looked: 255,
        };
        assert_eq!(colour(strong), [255, 236, 190]);
    }
}
