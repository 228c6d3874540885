//! Common parts of the plots: coordinates, colours, axes, and the header with title, caption and
//! legend.

use std::ops::Range;

use plotters::{
    coord::{Shift, types::RangedCoordf64},
    prelude::*,
    style::text_anchor,
};

use super::EvaluationError;

pub type Area<'a> = DrawingArea<SVGBackend<'a>, Shift>;

pub type Chart<'a, 'b> =
    ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Canvas units in a px. plotters rounds SVG coordinates to integers, which makes curves jagged:
/// everything is drawn this much larger and shown smaller.
const UNITS_PER_PX: u32 = 8;

pub const ESTIMATE: RGBColor = RGBColor(0, 98, 178);
pub const TRUTH: RGBColor = RGBColor(120, 124, 130);
pub const MARK: RGBColor = RGBColor(213, 94, 0);
/// The colours of text, of secondary text, and of grid lines.
pub const INK: RGBColor = RGBColor(34, 38, 44);
pub const QUIET: RGBColor = RGBColor(96, 102, 110);
pub const GRID: RGBColor = RGBColor(226, 229, 233);

/// Height of the header, px.
pub const HEADER: u32 = 84;

pub fn px(length: f64) -> u32 {
    (length * f64::from(UNITS_PER_PX)).round() as u32
}

/// Returns a font of `size` px. The SVG back end divides sizes by 1.24, which is compensated here.
pub fn font(size: f64, colour: RGBColor) -> TextStyle<'static> {
    let size = 1.24 * size * f64::from(UNITS_PER_PX);
    ("sans-serif", size).into_font().color(&colour)
}

pub fn line(colour: RGBColor, width: f64) -> ShapeStyle {
    colour.stroke_width(px(width))
}

/// Returns an empty diagram with margins, `bottom` px the lowest, and space for labels on the left
/// and, `below` px, below it.
pub fn chart<'a, 'b>(
    area: &Area<'b>,
    [bottom, below]: [u32; 2],
    x: Range<f64>,
    y: Range<f64>,
) -> Result<Chart<'a, 'b>, EvaluationError> {
    ChartBuilder::on(area)
        .margin_left(px(20.0))
        .margin_right(px(20.0))
        .margin_bottom(px(f64::from(bottom)))
        .set_label_area_size(LabelAreaPosition::Left, px(84.0))
        .set_label_area_size(LabelAreaPosition::Bottom, px(f64::from(below)))
        .build_cartesian_2d(x, y)
        .map_err(drawing)
}

/// Draws the grid and both axes with about so many ticks, and their descriptions.
pub fn axes(
    chart: &mut Chart<'_, '_>,
    [x_ticks, y_ticks]: [usize; 2],
    x_desc: Option<&str>,
    y_desc: &str,
) -> Result<(), EvaluationError> {
    let mut mesh = chart.configure_mesh();
    mesh.max_light_lines(0)
        .bold_line_style(line(GRID, 1.0))
        .axis_style(line(QUIET, 1.0))
        .set_all_tick_mark_size(px(5.0))
        .x_label_formatter(&number)
        .y_label_formatter(&number)
        .x_labels(x_ticks)
        .y_labels(y_ticks)
        .label_style(font(14.0, INK))
        .axis_desc_style(font(15.0, INK))
        .y_desc(y_desc);
    if let Some(x_desc) = x_desc {
        mesh.x_desc(x_desc);
    }
    mesh.draw().map_err(drawing)
}

pub fn curve(
    chart: &mut Chart<'_, '_>,
    points: impl IntoIterator<Item = (f64, f64)>,
    style: ShapeStyle,
) -> Result<(), EvaluationError> {
    let series = LineSeries::new(points, style);
    chart.draw_series(series).map(drop).map_err(drawing)
}

pub fn document(
    size: (u32, u32),
    draw: impl FnOnce(&Area<'_>) -> Result<(), EvaluationError>,
) -> Result<String, EvaluationError> {
    let fine = (size.0 * UNITS_PER_PX, size.1 * UNITS_PER_PX);
    let mut svg = String::new();
    {
        let area = SVGBackend::with_string(&mut svg, fine).into_drawing_area();
        area.fill(&WHITE).map_err(drawing)?;
        draw(&area)?;
        area.present().map_err(drawing)?;
    }
    let as_drawn = format!("<svg width=\"{}\" height=\"{}\"", fine.0, fine.1);
    let as_shown = format!(
        "<svg width=\"{}\" height=\"{}\" stroke-linejoin=\"round\" stroke-linecap=\"round\"",
        size.0, size.1
    );
    Ok(svg.replacen(&as_drawn, &as_shown, 1))
}

/// An entry of a legend: its label and its symbol.
pub type Entry<'a> = (&'a str, Symbol);

pub enum Symbol {
    Line(ShapeStyle),
    Area(RGBColor),
    /// A dot of [`MARK`]'s colour.
    Dot,
}

/// Draws the title, the caption below it, and the legend on the right.
pub fn header(
    area: &Area<'_>,
    title: &str,
    caption: &str,
    legend: &[Entry<'_>],
) -> Result<(), EvaluationError> {
    let at = |x: f64, y: f64| (px(x) as i32, px(y) as i32);
    let write = |text: &str, at: (i32, i32), font: TextStyle<'static>| {
        area.draw(&Text::new(text.to_owned(), at, font))
            .map_err(drawing)
    };
    write(title, at(24.0, 18.0), font(20.0, INK))?;
    write(caption, at(24.0, 48.0), font(14.0, QUIET))?;
    let centre = text_anchor::Pos::new(text_anchor::HPos::Left, text_anchor::VPos::Center);
    let label = font(14.0, INK).pos(centre);
    let width = f64::from(area.dim_in_pixel().0) / f64::from(UNITS_PER_PX);
    let mut x = width - 24.0 - legend.iter().map(entry_width).sum::<f64>();
    for entry in legend {
        match entry.1 {
            Symbol::Line(style) => {
                area.draw(&PathElement::new([at(x, 28.0), at(x + 26.0, 28.0)], style))
            }
            Symbol::Area(colour) => {
                let corners = [at(x, 21.0), at(x + 26.0, 35.0)];
                area.draw(&Rectangle::new(corners, colour.filled()))
            }
            Symbol::Dot => area.draw(&dot(at(x + 18.0, 28.0))),
        }
        .map_err(drawing)?;
        write(entry.0, at(x + 33.0, 28.0), label.clone())?;
        x += entry_width(entry);
    }
    Ok(())
}

pub fn dot<C>(at: C) -> Circle<C, u32> {
    Circle::new(at, px(6.0), MARK.filled())
}

/// Formats the number of a tick without trailing zeros.
pub fn number(value: &f64) -> String {
    let text = format!("{value:.3}");
    let text = text.trim_end_matches('0').trim_end_matches('.');
    if text == "-0" { "0" } else { text }.to_owned()
}

/// Returns the width of an entry, px; a letter of a 14 px sans-serif font is about half as wide as
/// high.
fn entry_width(entry: &Entry<'_>) -> f64 {
    33.0 + 7.6 * entry.0.len() as f64 + 14.0
}

pub fn drawing<E: std::error::Error + Send + Sync>(
    error: DrawingAreaErrorKind<E>,
) -> EvaluationError {
    EvaluationError(format!("failed to draw: {error}"))
}
