//! Lines and text over the ground of a picture.

use noto_sans_mono_bitmap::{FontWeight, RasterHeight, get_raster, get_raster_width};
use tiny_skia::{
    FillRule, FilterQuality, LineCap, LineJoin, Paint, Path, PathBuilder, Pixmap, PixmapPaint,
    PremultipliedColorU8, Stroke, Transform,
};

use super::ground::Ground;
use crate::mapping::{Cell, MapError, pixels};
use nalgebra::Point2;

pub type Colour = [u8; 3];

#[derive(Clone, Copy)]
pub struct Pen {
    pub colour: Colour,
    pub width: f32,
    pub opacity: f32,
}

impl Pen {
    pub const fn opaque(colour: Colour, width: f32) -> Self {
        Self {
            colour,
            width,
            opacity: 1.0,
        }
    }
}

const GLYPHS: RasterHeight = RasterHeight::Size32;
const MIN_WIDTH: f32 = 900.0;
const FOOTER: f32 = 44.0;
const MARGIN: f32 = 20.0;
/// Points of a line that are nearer to each other are one, px.
const NEAR_PX: f32 = 0.5;
const TEXT: f32 = 15.0;
const LONGEST_BAR: f64 = 160.0;
/// Pixels of a unit: 1 up to this size of a picture, and in proportion beyond.
const UNIT_SIDE: f32 = 1300.0;

pub struct Canvas {
    pixmap: Pixmap,
    /// Pixels of a unit: drawn elements have the same share of every picture.
    unit: f32,
    pub view: View,
    footer: f32,
}

#[derive(Clone, Copy)]
pub struct View {
    corner_m: nalgebra::Vector2<f64>,
    pixel_m: f64,
    left: f32,
}

impl View {
    pub fn pixel(&self, place: &Point2<f64>) -> (f32, f32) {
        let from = (place.coords - self.corner_m) / self.pixel_m;
        (from.x as f32 + self.left, -from.y as f32)
    }
}

impl Canvas {
    pub fn over(ground: &Ground) -> Result<Self, MapError> {
        let height = ground.height();
        let unit = (ground.width.max(height) as f32 / UNIT_SIDE).max(1.0);
        let width = ground.width.max((MIN_WIDTH * unit).ceil() as usize);
        let whole = height + (FOOTER * unit).ceil() as usize;
        let pixmap = Pixmap::new(width as u32, whole as u32)
            .ok_or_else(|| MapError::Encode(format!("{width} x {whole} pixels")))?;
        let left = (width - ground.width) / 2;
        let mut canvas = Self {
            pixmap,
            unit,
            view: View {
                corner_m: ground.corner_m,
                pixel_m: ground.pixel_m,
                left: left as f32,
            },
            footer: height as f32 + 0.5 * FOOTER * unit,
        };
        canvas.paint(ground, left);
        Ok(canvas)
    }

    fn paint(&mut self, ground: &Ground, left: usize) {
        let width = self.width();
        let opaque = |[red, green, blue]: Colour| {
            PremultipliedColorU8::from_rgba(red, green, blue, u8::MAX)
                .unwrap_or(PremultipliedColorU8::TRANSPARENT)
        };
        let pixels = self.pixmap.pixels_mut();
        pixels.fill(opaque(pixels::colour(Cell::default())));
        let rows = pixels.chunks_exact_mut(width);
        for (pixels, cells) in rows.zip(ground.cells.chunks_exact(ground.width)) {
            for (pixel, cell) in pixels[left..].iter_mut().zip(cells) {
                *pixel = opaque(pixels::colour(*cell));
            }
        }
    }

    pub fn width(&self) -> usize {
        self.pixmap.width() as usize
    }

    pub fn rgb(&self) -> Vec<u8> {
        let pixels = self.pixmap.pixels().iter();
        pixels
            .flat_map(|p| [p.red(), p.green(), p.blue()])
            .collect()
    }

    pub fn lines<P: AsRef<[(f32, f32)]>>(&mut self, lines: impl IntoIterator<Item = P>, pen: Pen) {
        let mut builder = PathBuilder::new();
        for line in lines {
            add_line(&mut builder, line.as_ref());
        }
        let stroke = Stroke {
            width: pen.width * self.unit,
            line_cap: LineCap::Round,
            line_join: LineJoin::Round,
            ..Stroke::default()
        };
        if let Some(path) = builder.finish() {
            let paint = paint(pen.colour, pen.opacity);
            self.pixmap
                .stroke_path(&path, &paint, &stroke, Transform::identity(), None);
        }
    }

    fn fill(&mut self, path: Option<Path>, colour: Colour) {
        if let Some(path) = path {
            let paint = paint(colour, 1.0);
            self.pixmap.fill_path(
                &path,
                &paint,
                FillRule::Winding,
                Transform::identity(),
                None,
            );
        }
    }

    /// Draws a dot with an arrow in a direction of length 1.
    pub fn arrow(&mut self, (x, y): (f32, f32), (right, down): (f32, f32), colour: Colour) {
        let length = |units: f32| units * self.unit;
        let ahead = |units: f32, aside: f32| {
            let (along, across) = (length(units), length(aside));
            (
                x + along * right - across * down,
                y + along * down + across * right,
            )
        };
        let head = [ahead(34.0, 0.0), ahead(22.0, 6.5), ahead(22.0, -6.5)];
        let shaft = [(x, y), ahead(24.0, 0.0)];
        let dot = PathBuilder::from_circle(x, y, length(5.0));
        let mut triangle = PathBuilder::new();
        triangle.move_to(head[0].0, head[0].1);
        triangle.line_to(head[1].0, head[1].1);
        triangle.line_to(head[2].0, head[2].1);
        triangle.close();
        self.lines([shaft], Pen::opaque(colour, 3.0));
        self.fill(dot, colour);
        self.fill(triangle.finish(), colour);
    }

    /// Draws a bar of a round length at the left of the footer; returns where the next entry
    /// begins.
    pub fn scale_bar(&mut self, colour: Colour) -> f32 {
        let longest_m = LONGEST_BAR * f64::from(self.unit) * self.view.pixel_m;
        let length_m = round_length_m(longest_m);
        let length = (length_m / self.view.pixel_m) as f32;
        let (left, y, tick) = (MARGIN * self.unit, self.footer, 5.0 * self.unit);
        let right = left + length;
        let ticks = [left, right].map(|x| [(x, y - tick), (x, y + tick)]);
        let pen = Pen::opaque(colour, 2.0);
        self.lines([[(left, y), (right, y)]], pen);
        self.lines(ticks, pen);
        let pixel_m = (self.view.pixel_m * 1e3).round() / 1e3;
        let label = format!("{length_m} m, {pixel_m} m/px");
        self.text(right + 8.0 * self.unit, &label, colour)
    }

    pub fn entry(&mut self, left: f32, colour: Colour, label: &str, text: Colour) -> f32 {
        let end = left + 22.0 * self.unit;
        let sample = [(left, self.footer), (end, self.footer)];
        self.lines([sample], Pen::opaque(colour, 3.0));
        self.text(end + 8.0 * self.unit, label, text)
    }

    fn text(&mut self, left: f32, text: &str, colour: Colour) -> f32 {
        let scale = TEXT * self.unit / GLYPHS.val() as f32;
        let advance = get_raster_width(FontWeight::Regular, GLYPHS) as f32 * scale;
        let top = self.footer - 0.5 * TEXT * self.unit;
        let paint = PixmapPaint {
            quality: FilterQuality::Bilinear,
            ..PixmapPaint::default()
        };
        let mut x = left;
        for character in text.chars() {
            if let Some(glyph) = glyph(character, colour) {
                let place = Transform::from_row(scale, 0.0, 0.0, scale, x, top);
                self.pixmap
                    .draw_pixmap(0, 0, glyph.as_ref(), &paint, place, None);
            }
            x += advance;
        }
        x + 26.0 * self.unit
    }
}

/// Adds a line without the points that are indistinguishably near to the one before.
fn add_line(builder: &mut PathBuilder, points: &[(f32, f32)]) {
    let mut points = points
        .iter()
        .filter(|(x, y)| x.is_finite() && y.is_finite());
    let Some(&(x, y)) = points.next() else {
        return;
    };
    builder.move_to(x, y);
    let (mut last, mut end) = ((x, y), None);
    for &(x, y) in points {
        end = Some((x, y));
        if (x - last.0).hypot(y - last.1) >= NEAR_PX {
            builder.line_to(x, y);
            (last, end) = ((x, y), None);
        }
    }
    // The last one is drawn wherever it is, so that a line has its end, and one of two equal points
    // is a dot.
    if let Some((x, y)) = end {
        builder.line_to(x, y);
    }
}

fn paint([red, green, blue]: Colour, opacity: f32) -> Paint<'static> {
    let mut paint = Paint::default();
    let opacity = (opacity * f32::from(u8::MAX)).round() as u8;
    paint.set_color_rgba8(red, green, blue, opacity);
    paint
}

/// A character in a colour, as opaque as it is bright.
fn glyph(character: char, colour: Colour) -> Option<Pixmap> {
    let raster = get_raster(character, FontWeight::Regular, GLYPHS)?;
    let mut glyph = Pixmap::new(raster.width() as u32, raster.height() as u32)?;
    let brightness = raster.rows().flatten();
    for (pixel, &alpha) in glyph.pixels_mut().iter_mut().zip(brightness) {
        let [red, green, blue] =
            colour.map(|c| (u16::from(c) * u16::from(alpha) / u16::from(u8::MAX)) as u8);
        *pixel = PremultipliedColorU8::from_rgba(red, green, blue, alpha)?;
    }
    Some(glyph)
}

/// The longest of 1, 2, 5, 10, 20, ... metres that is not longer than `longest_m`.
fn round_length_m(longest_m: f64) -> f64 {
    let power = 10f64.powf(longest_m.log10().floor());
    let step = [5.0, 2.0, 1.0]
        .into_iter()
        .find(|step| step * power <= longest_m);
    step.unwrap_or(1.0) * power
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_scale_bar_has_a_round_length() {
        let lengths = [0.7, 1.0, 19.9, 20.0, 499.0, 5e3].map(round_length_m);
        assert_eq!(lengths, [0.5, 1.0, 10.0, 20.0, 200.0, 5e3]);
    }
}
