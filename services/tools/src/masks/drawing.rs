//! A picture of the mask's effect. Side by side: the raster with all its power, the mask (black is
//! nothing, white is all), the input of the search, and the points, each in the colour of its
//! factor. Where the mask looks at two scans, the scan before is below. Ahead is up, left is left.

use std::path::Path;

use gyre_configuration::terminal::Failure;
use gyre_slam::mapping::encode_png;
use ndarray::Array2;
use png::ColorType;

use crate::masks::inspector::{Inspection, MaskedRaster};

type Colour = [u8; 3];

const MARGIN: usize = 6;
const AROUND: Colour = [60; 3];
/// Panels are enlarged to about so many pixels a side.
const SIDE: usize = 256;
/// Power, in the sensor's counts, with the brightest colour: higher powers are rare.
const BRIGHT: f32 = 120.0;
/// The share of cells with the brightest colour in the input of the search, where only proportions
/// count.
const BRIGHTEST: f32 = 1e-3;
/// Maximum brightness of the raster behind the points.
const FAINT: f32 = 0.4;
pub struct Canvas {
    width: usize,
    /// Row by row.
    pixels: Vec<Colour>,
}

impl Canvas {
    pub fn of(inspection: &Inspection) -> Self {
        let rows: Vec<[Array2<Colour>; 4]> = inspection.rasters.iter().map(panels).collect();
        let n = rows.first().map_or(1, |panels| panels[0].nrows());
        let scale = (SIDE / n).max(1);
        let step = n * scale + MARGIN;
        let (width, height) = (4 * step + MARGIN, rows.len() * step + MARGIN);
        let mut canvas = Self {
            width,
            pixels: vec![AROUND; width * height],
        };
        for (row, panels) in rows.iter().enumerate() {
            for (column, panel) in panels.iter().enumerate() {
                let corner = [MARGIN + row * step, MARGIN + column * step];
                for (cell, colour) in panel.indexed_iter() {
                    canvas.square(place(corner, cell.into(), scale), scale, *colour);
                }
            }
        }
        canvas.mark_points(&inspection.points, scale, [MARGIN, MARGIN + 3 * step]);
        canvas
    }

    pub fn stack(pictures: &[Self]) -> Self {
        let pixels = pictures.iter().flat_map(|picture| &picture.pixels);
        Self {
            width: pictures.first().map_or(0, |picture| picture.width),
            pixels: pixels.copied().collect(),
        }
    }

    pub fn write(&self, path: &Path) -> Result<(), Failure> {
        let picture = encode_png(self.width, ColorType::Rgb, self.pixels.as_flattened())?;
        Ok(gyre_storage::write(path, picture)?)
    }

    fn square(&mut self, [row, column]: [usize; 2], side: usize, colour: Colour) {
        for row in row..row + side {
            self.pixels[row * self.width + column..][..side].fill(colour);
        }
    }

    /// Dots a pixel larger than a cell; those that count most are on top.
    fn mark_points(&mut self, points: &[([usize; 2], f32)], scale: usize, corner: [usize; 2]) {
        let mut points = points.to_vec();
        points.sort_by(|a, b| a.1.total_cmp(&b.1));
        for (cell, factor) in points {
            self.square(place(corner, cell, scale), scale + 1, colour(factor));
        }
    }
}

/// Returns the pixel where a cell begins that is drawn as a square of `scale` pixels a side.
fn place(corner: [usize; 2], cell: [usize; 2], scale: usize) -> [usize; 2] {
    [0, 1].map(|axis| corner[axis] + cell[axis] * scale)
}

fn panels(raster: &MaskedRaster) -> [Array2<Colour>; 4] {
    let brightest = exceeded_by(BRIGHTEST, &raster.masked).max(f32::MIN_POSITIVE);
    [
        raster.whole.map(|power| colour(power / BRIGHT)),
        raster.mask.map(|factor| grey(*factor)),
        // The root shows faint echoes, too.
        raster
            .masked
            .map(|power| colour((power / brightest).sqrt())),
        raster.whole.map(|power| grey(FAINT * power / BRIGHT)),
    ]
}

fn exceeded_by(share: f32, cells: &Array2<f32>) -> f32 {
    let mut cells: Vec<f32> = cells.iter().copied().collect();
    let rank = cells.len() - 1 - (share * cells.len() as f32) as usize;
    *cells.select_nth_unstable_by(rank, f32::total_cmp).1
}

fn grey(share: f32) -> Colour {
    [(255.0 * share.clamp(0.0, 1.0)).round() as u8; 3]
}

/// From nothing (dark violet) to all (yellow), of evenly growing brightness.
fn colour(share: f32) -> Colour {
    let colour = colorous::VIRIDIS.eval_continuous(f64::from(share).clamp(0.0, 1.0));
    [colour.r, colour.g, colour.b]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_brightest_colour_goes_to_a_share_of_the_cells() {
        let cells = Array2::from_shape_fn((40, 50), |(row, column)| {
            ((row * 50 + column) * 7 % 2000) as f32
        });
        assert_eq!(exceeded_by(1e-3, &cells), 1997.0);
        assert_eq!(exceeded_by(0.0, &cells), 1999.0);
        assert_eq!(exceeded_by(0.5, &Array2::from_elem((1, 1), 3.0)), 3.0);
        assert_eq!((colour(-1.0), colour(9.0)), (colour(0.0), colour(1.0)));
        let [dark, bright] = [0.1, 0.9].map(|share| colour(share).map(u32::from));
        assert!(dark.iter().sum::<u32>() < bright.iter().sum::<u32>());
    }

    #[test]
    fn panels_stand_side_by_side_and_scans_below_each_other() {
        let raster = |power: f32| MaskedRaster {
            whole: Array2::from_elem((4, 4), power),
            mask: Array2::from_elem((4, 4), 0.5),
            masked: Array2::from_elem((4, 4), 0.5 * power),
            above_floor: 16.0,
        };
        let inspection = |rasters: Vec<MaskedRaster>| Inspection {
            number: 0,
            rasters,
            points: vec![([3, 3], 1.0)],
            twist: None,
        };
        let [one, two] = [vec![raster(30.0)], vec![raster(30.0), raster(120.0)]]
            .map(|rasters| Canvas::of(&inspection(rasters)));
        let width = 4 * 256 + 5 * MARGIN;
        assert_eq!((one.width, two.width), (width, width));
        assert_eq!(one.pixels.len() / width, 256 + 2 * MARGIN);
        assert_eq!(two.pixels.len() / width, 2 * 256 + 3 * MARGIN);
        let at = |canvas: &Canvas, row: usize, panel: usize| {
            canvas.pixels[row * canvas.width + MARGIN + panel * (256 + MARGIN)]
        };
        let panels = [0, 1, 2, 3].map(|panel| at(&two, MARGIN, panel));
        assert_eq!(panels, [colour(0.25), grey(0.5), colour(1.0), grey(0.1)]);
        assert_eq!(at(&two, 256 + 2 * MARGIN, 0), colour(1.0));
        assert_eq!(at(&one, MARGIN - 1, 0), AROUND);
        // The last cell's dot.
        let end = (MARGIN + 255) * one.width + MARGIN + 3 * (256 + MARGIN) + 255;
        assert_eq!(one.pixels[end], colour(1.0));
        assert_eq!(Canvas::stack(&[one]).pixels.len(), 268 * 1054);
    }
}
