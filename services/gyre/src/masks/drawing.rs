//! What became of a scan, as a picture. Side by side: the raster with all its power, the mask (black is nothing, white is all), what the
//! search gets, and the points, each in the colour of its factor. Where the mask looks at two scans, the scan before stands below.
//! Ahead is up, left is left.

use std::path::Path;

use crate::picture::{PictureError, write_rgb};

use super::exposure::{Exposure, View};

type Colour = [u8; 3];

/// Pixels around each panel.
const MARGIN: usize = 6;
const AROUND: Colour = [60; 3];
/// Panels are enlarged to about so many pixels a side.
const SIDE: usize = 256;
/// Power, in the sensor's counts, that has the brightest colour: what is above is rare.
const BRIGHT: f32 = 120.0;
/// The share of cells that the brightest colour goes to in what the search gets, of which proportions alone count.
const BRIGHTEST: f32 = 1e-3;
/// How bright the raster behind the points is at its brightest.
const FAINT: f32 = 0.4;
/// From nothing to all: from dark violet by green to yellow, of evenly growing brightness ("viridis").
const COLOURS: [Colour; 9] = [
    [68, 1, 84],
    [71, 44, 122],
    [59, 81, 139],
    [44, 113, 142],
    [33, 144, 141],
    [39, 173, 129],
    [92, 200, 99],
    [170, 220, 50],
    [253, 231, 37],
];

/// A picture in colour.
pub struct Canvas {
    width: usize,
    /// Row by row.
    pixels: Vec<Colour>,
}

impl Canvas {
    /// See the module.
    pub fn of(exposure: &Exposure) -> Self {
        let rows: Vec<[Vec<Colour>; 4]> = exposure.views.iter().map(panels).collect();
        let scale = (SIDE / exposure.n).max(1);
        let step = exposure.n * scale + MARGIN;
        let (width, height) = (4 * step + MARGIN, rows.len() * step + MARGIN);
        let mut canvas = Self {
            width,
            pixels: vec![AROUND; width * height],
        };
        for (row, panels) in rows.iter().enumerate() {
            for (column, panel) in panels.iter().enumerate() {
                canvas.place(
                    panel,
                    exposure.n,
                    scale,
                    [MARGIN + row * step, MARGIN + column * step],
                );
            }
        }
        canvas.mark_points(exposure, scale, [MARGIN, MARGIN + 3 * step]);
        canvas
    }

    /// Pictures of one width below each other.
    pub fn stack(pictures: &[Self]) -> Self {
        let width = pictures.first().map_or(0, |picture| picture.width);
        Self {
            width,
            pixels: pictures
                .iter()
                .flat_map(|picture| &picture.pixels)
                .copied()
                .collect(),
        }
    }

    /// Writes it as PNG.
    ///
    /// # Errors
    /// [`PictureError`] names the file.
    pub fn write(&self, path: &Path) -> Result<(), PictureError> {
        write_rgb(path, self.width, &self.pixels)
    }

    /// Draws `n` x `n` cells, each as a square of `scale` pixels a side.
    fn place(&mut self, cells: &[Colour], n: usize, scale: usize, corner: [usize; 2]) {
        for (cell, colour) in cells.iter().enumerate() {
            self.square(
                [corner[0] + cell / n * scale, corner[1] + cell % n * scale],
                scale,
                *colour,
            );
        }
    }

    fn square(&mut self, [row, column]: [usize; 2], side: usize, colour: Colour) {
        for row in row..row + side {
            self.pixels[row * self.width + column..][..side].fill(colour);
        }
    }

    /// Dots a pixel larger than a cell; those that count most are on top.
    fn mark_points(&mut self, exposure: &Exposure, scale: usize, corner: [usize; 2]) {
        let mut points = exposure.points.clone();
        points.sort_by(|a, b| a.1.total_cmp(&b.1));
        for (cell, factor) in points {
            let place = [
                corner[0] + cell / exposure.n * scale,
                corner[1] + cell % exposure.n * scale,
            ];
            self.square(place, scale + 1, colour(factor));
        }
    }
}

/// The panels of a raster, without the points.
fn panels(view: &View) -> [Vec<Colour>; 4] {
    let draw = |cells: &[f32], colour: &dyn Fn(f32) -> Colour| {
        cells.iter().map(|value| colour(*value)).collect()
    };
    let brightest = exceeded_by(BRIGHTEST, &view.masked).max(f32::MIN_POSITIVE);
    [
        draw(&view.whole, &|power| colour(power / BRIGHT)),
        draw(&view.mask, &grey),
        // The root shows what is faint, too.
        draw(&view.masked, &|power| colour((power / brightest).sqrt())),
        draw(&view.whole, &|power| grey(FAINT * power / BRIGHT)),
    ]
}

/// The value that this share of the cells exceeds.
fn exceeded_by(share: f32, cells: &[f32]) -> f32 {
    let mut cells = cells.to_vec();
    let rank = cells.len() - 1 - (share * cells.len() as f32) as usize;
    *cells.select_nth_unstable_by(rank, f32::total_cmp).1
}

fn grey(share: f32) -> Colour {
    [(255.0 * share.clamp(0.0, 1.0)).round() as u8; 3]
}

/// Between [`COLOURS`].
fn colour(share: f32) -> Colour {
    let place = share.clamp(0.0, 1.0) * (COLOURS.len() - 1) as f32;
    let below = (place as usize).min(COLOURS.len() - 2);
    let between = |channel: usize| {
        let [from, to] = [below, below + 1].map(|index| f32::from(COLOURS[index][channel]));
        (from + (to - from) * (place - below as f32)).round() as u8
    };
    [between(0), between(1), between(2)]
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn colours_run_from_dark_to_bright() {
        assert_eq!((colour(-1.0), colour(0.0)), (COLOURS[0], COLOURS[0]));
        assert_eq!(
            (colour(0.5), colour(1.0), colour(9.0)),
            (COLOURS[4], COLOURS[8], COLOURS[8])
        );
        let brightness = |share: usize| {
            colour(share as f32 / 16.0)
                .map(u32::from)
                .iter()
                .sum::<u32>()
        };
        assert!((0..16).all(|share| brightness(share) < brightness(share + 1)));
    }

    #[test]
    fn the_brightest_colour_goes_to_a_share_of_the_cells() {
        let cells: Vec<f32> = (0..2000).map(|cell| (cell * 7 % 2000) as f32).collect();
        assert_eq!(
            (
                exceeded_by(1e-3, &cells),
                exceeded_by(0.0, &cells),
                exceeded_by(0.5, &[3.0])
            ),
            (1997.0, 1999.0, 3.0)
        );
    }

    #[test]
    fn panels_stand_side_by_side_and_scans_below_each_other() {
        let view = |power: f32| View {
            whole: vec![power; 16],
            mask: vec![0.5; 16],
            masked: vec![0.5 * power; 16],
            above_floor: 16.0,
        };
        let exposure = |views: Vec<View>| Exposure {
            number: 0,
            n: 4,
            views,
            points: vec![(15, 1.0)],
            twist: None,
        };
        let [one, two] = [vec![view(30.0)], vec![view(30.0), view(120.0)]]
            .map(|views| Canvas::of(&exposure(views)));
        assert_eq!(
            (one.width, one.pixels.len() / one.width),
            (4 * 256 + 5 * MARGIN, 256 + 2 * MARGIN)
        );
        assert_eq!(
            (two.width, two.pixels.len() / two.width),
            (one.width, 2 * 256 + 3 * MARGIN)
        );
        let at = |canvas: &Canvas, row: usize, panel: usize| {
            canvas.pixels[row * canvas.width + MARGIN + panel * (256 + MARGIN)]
        };
        assert_eq!(
            [0, 1, 2, 3].map(|panel| at(&two, MARGIN, panel)),
            [colour(0.25), grey(0.5), colour(1.0), grey(0.1)]
        );
        assert_eq!(at(&two, 256 + 2 * MARGIN, 0), colour(1.0));
        assert_eq!(at(&one, MARGIN - 1, 0), AROUND);
        // The last cell's dot.
        let end = (MARGIN + 255) * one.width + MARGIN + 3 * (256 + MARGIN) + 255;
        assert_eq!(
            (one.pixels[end], Canvas::stack(&[one]).pixels.len()),
            (colour(1.0), 268 * 1054)
        );
    }
}
