//! The plots: latency by percentile of all scenarios, and latency over time of one.

use std::ops::Range;

use gyre_evaluation::plot::{
    PlotError,
    canvas::{Area, GRID, HEADER, INK, MARK, QUIET, document, drawing, font, header, line, px},
};
use plotters::{
    coord::{Shift, types::RangedCoordf64},
    prelude::*,
    style::text_anchor::{HPos, Pos, VPos},
};

use super::{Figures, ScenarioOutcome};
use crate::fault::FaultKind;

/// Size of a document, px.
const SIZE: (u32, u32) = (900, 520);
/// Width of the legend, px.
const LEGEND: u32 = 220;
/// Steps of the axis of latency, ms.
const TICKS_MS: [f64; 13] = [
    1.0, 2.0, 5.0, 10.0, 20.0, 50.0, 100.0, 200.0, 500.0, 1e3, 2e3, 5e3, 1e4,
];
/// Okabe and Ito's colours, which people with any kind of colour vision tell apart, then dashed for
/// the rest.
const COLOURS: [RGBColor; 7] = [
    RGBColor(0, 114, 178),
    RGBColor(230, 159, 0),
    RGBColor(0, 158, 115),
    RGBColor(213, 94, 0),
    RGBColor(86, 180, 233),
    RGBColor(204, 121, 167),
    RGBColor(0, 0, 0),
];
/// The colour of faults.
const FAULT: RGBColor = RGBColor(150, 154, 160);
/// Room above the largest latency for the names of faults, as a factor.
const HEADROOM: f64 = 2.5;
/// Marks fewer than these are drawn as dots.
const DOTS: usize = 400;

type Chart<'a, 'b> = ChartContext<'a, SVGBackend<'b>, Cartesian2d<RangedCoordf64, RangedCoordf64>>;

/// Draws the latency of all scenarios over the percentile; `None` if none has one.
///
/// # Errors
/// A plot that cannot be drawn.
pub fn percentiles(
    outcomes: &[ScenarioOutcome],
    machine: &str,
) -> Result<Option<String>, PlotError> {
    let curves: Vec<_> = outcomes
        .iter()
        .filter_map(|outcome| {
            let latency = &outcome.figures.as_ref()?.latency.sensor_to_pose;
            (!latency.curve.is_empty()).then(|| (outcome.scenario.name(), latency.curve.as_slice()))
        })
        .collect();
    let all = || curves.iter().flat_map(|(_, curve)| *curve);
    let Some(range_ms) = range_of(all().map(|(_, ms)| *ms)) else {
        return Ok(None);
    };
    let nines = all().map(|(x, _)| *x).fold(1.0, f64::max);
    let svg = document(SIZE, |area| {
        let caption = format!(
            "every scan that was due counts, dropped ones until the pose that replaced them; {machine}"
        );
        header(area, "Sensor to pose by percentile", &caption, &[])?;
        let below = area.split_vertically(px(f64::from(HEADER))).1;
        let width = below.dim_in_pixel().0;
        let (left, right) = below.split_horizontally(width - px(f64::from(LEGEND)));
        let mut chart = chart(&left, 0.0..nines * 1.02, &range_ms)?;
        let marks: Vec<_> = (0..=nines.floor() as i32).map(f64::from).collect();
        let names = marks.iter().map(|nines| (*nines, percentile(*nines)));
        axes(
            &left,
            &mut chart,
            &range_ms,
            &names.collect::<Vec<_>>(),
            "percentile",
        )?;
        for (index, (_, curve)) in curves.iter().enumerate() {
            draw_curve(&mut chart, index, curve)?;
        }
        legend(&right, &curves)
    });
    svg.map(Some)
}

/// Draws the latency of a scenario over time, with its drops and faults.
///
/// # Errors
/// A plot that cannot be drawn.
pub fn timeline(outcome: &ScenarioOutcome, figures: &Figures) -> Result<String, PlotError> {
    let samples = &figures.latency.timeline;
    let mut range_ms = range_of(samples.iter().map(|it| it.latency_ms)).ok_or(PlotError::Empty)?;
    if figures.had_faults() {
        range_ms.end *= HEADROOM;
    }
    let end_s = samples
        .iter()
        .map(|it| it.due_s)
        .fold(outcome.duration_s, f64::max);
    document(SIZE, |area| {
        let title = format!("{}: sensor to pose over time", outcome.scenario);
        header(area, &title, &caption(figures), &[])?;
        let below = area.split_vertically(px(f64::from(HEADER))).1;
        let mut chart = chart(&below, 0.0..end_s * 1.01, &range_ms)?;
        let seconds = seconds(end_s);
        axes(
            &below,
            &mut chart,
            &range_ms,
            &seconds,
            "time at which the scan was due, s",
        )?;
        draw_faults(&below, &mut chart, figures, &range_ms)?;
        let posed = samples.iter().filter(|it| !it.dropped);
        let at = |it: &crate::record::Sample| (it.due_s, it.latency_ms.max(range_ms.start).log10());
        let radius = if samples.len() <= DOTS { 2.5 } else { 1.5 };
        let dots = posed.map(|it| Circle::new(at(it), px(radius), COLOURS[0].filled()));
        chart.draw_series(dots).map_err(drawing)?;
        let dropped = samples.iter().filter(|it| it.dropped);
        let crosses = dropped.map(|it| Cross::new(at(it), px(3.0), line(MARK, 1.5)));
        chart.draw_series(crosses).map_err(drawing)?;
        Ok(())
    })
}

fn caption(figures: &Figures) -> String {
    let counts = figures.latency.counts;
    let mut parts = vec![format!("dots: {} scans with a pose", counts.posed)];
    if counts.dropped > 0 {
        parts.push(format!(
            "crosses: {} dropped, until the pose that replaced them",
            counts.dropped
        ));
    }
    if figures.had_faults() {
        parts.push("grey: faults".to_owned());
    }
    parts.join("; ")
}

/// Returns the range of the axis: whole ticks around all values.
fn range_of(values_ms: impl Iterator<Item = f64>) -> Option<Range<f64>> {
    let (low, high) = values_ms.fold(None, |range: Option<(f64, f64)>, ms| {
        let (low, high) = range.unwrap_or((ms, ms));
        Some((low.min(ms), high.max(ms)))
    })?;
    let below = TICKS_MS.iter().rev().find(|tick| **tick <= low);
    let above = TICKS_MS.iter().find(|tick| **tick >= high * 1.05);
    let (low, high) = (
        *below.unwrap_or(&TICKS_MS[0]),
        *above.unwrap_or(&(high * 1.2)),
    );
    Some(low..high.max(low * 2.0))
}

/// A diagram whose vertical axis is the logarithm of ms.
fn chart<'a, 'b>(
    area: &'a DrawingArea<SVGBackend<'b>, Shift>,
    x: Range<f64>,
    range_ms: &Range<f64>,
) -> Result<Chart<'a, 'b>, PlotError> {
    ChartBuilder::on(area)
        .margin_left(px(20.0))
        .margin_right(px(20.0))
        .margin_bottom(px(16.0))
        .set_label_area_size(LabelAreaPosition::Left, px(84.0))
        .set_label_area_size(LabelAreaPosition::Bottom, px(46.0))
        .build_cartesian_2d(x, range_ms.start.log10()..range_ms.end.log10())
        .map_err(drawing)
}

/// Draws grid and axes with the given marks on the horizontal one.
fn axes(
    area: &Area<'_>,
    chart: &mut Chart<'_, '_>,
    range_ms: &Range<f64>,
    marks: &[(f64, String)],
    description: &str,
) -> Result<(), PlotError> {
    chart
        .configure_mesh()
        .disable_mesh()
        .x_labels(0)
        .y_labels(0)
        .axis_style(line(QUIET, 1.0))
        .axis_desc_style(font(15.0, INK))
        .x_desc(description)
        .y_desc("latency, ms")
        .draw()
        .map_err(drawing)?;
    let x = chart.x_range();
    let (bottom, top) = (range_ms.start.log10(), range_ms.end.log10());
    let ticks = TICKS_MS
        .iter()
        .filter(|tick| range_ms.contains(tick) || **tick == range_ms.end);
    for tick in ticks {
        let y = tick.log10();
        grid(chart, [(x.start, y), (x.end, y)])?;
        let place = Pos::new(HPos::Right, VPos::Center);
        label(
            area,
            chart,
            (x.start, y),
            (-8, 0),
            &format!("{tick}"),
            place,
        )?;
    }
    for (mark, name) in marks {
        grid(chart, [(*mark, bottom), (*mark, top)])?;
        let place = Pos::new(HPos::Center, VPos::Top);
        label(area, chart, (*mark, bottom), (0, 8), name, place)?;
    }
    Ok(())
}

fn grid(chart: &mut Chart<'_, '_>, ends: [(f64, f64); 2]) -> Result<(), PlotError> {
    let drawn = chart.draw_series([PathElement::new(ends, line(GRID, 1.0))]);
    drawn.map(drop).map_err(drawing)
}

/// Writes into `area`, which holds the diagram, beside a point of the diagram, `(right, down)` px
/// from it.
fn label(
    area: &Area<'_>,
    chart: &Chart<'_, '_>,
    at: (f64, f64),
    (right, down): (i32, i32),
    text: &str,
    place: Pos,
) -> Result<(), PlotError> {
    let (x, y) = chart.backend_coord(&at);
    let unit = px(1.0) as i32;
    let (left, top) = area.get_base_pixel();
    let at = (x - left + right * unit, y - top + down * unit);
    let text = Text::new(text.to_owned(), at, font(14.0, INK).pos(place));
    area.draw(&text).map_err(drawing)
}

fn percentile(nines: f64) -> String {
    match nines as i32 {
        0 => "0 %".to_owned(),
        1 => "90 %".to_owned(),
        2 => "99 %".to_owned(),
        nines => format!("99.{} %", "9".repeat(nines.max(2) as usize - 2)),
    }
}

/// Returns marks for seconds, about ten of them.
fn seconds(end_s: f64) -> Vec<(f64, String)> {
    let steps = [
        1.0, 2.0, 5.0, 10.0, 20.0, 60.0, 120.0, 300.0, 600.0, 1800.0, 3600.0,
    ];
    let step = steps.into_iter().find(|step| end_s / step <= 12.0);
    let step = step.unwrap_or(end_s / 10.0);
    let count = (end_s / step) as usize;
    (0..=count)
        .map(|index| index as f64 * step)
        .map(|mark| (mark, format!("{mark:.0}")))
        .collect()
}

fn draw_curve(
    chart: &mut Chart<'_, '_>,
    index: usize,
    curve: &[(f64, f64)],
) -> Result<(), PlotError> {
    let style = line(COLOURS[index % COLOURS.len()], 2.0);
    let points = curve.iter().map(|(x, ms)| (*x, ms.max(1e-3).log10()));
    let drawn = match index < COLOURS.len() {
        true => chart.draw_series(LineSeries::new(points, style)).map(drop),
        false => chart
            .draw_series(DashedLineSeries::new(points, px(6.0), px(5.0), style))
            .map(drop),
    };
    drawn.map_err(drawing)
}

/// Names the curves, the slowest first, with their medians and maxima.
fn legend(area: &Area<'_>, curves: &[(&str, &[(f64, f64)])]) -> Result<(), PlotError> {
    let last = |curve: &[(f64, f64)]| curve.last().map_or(0.0, |(_, ms)| *ms);
    let mut order: Vec<usize> = (0..curves.len()).collect();
    order.sort_by(|a, b| last(curves[*b].1).total_cmp(&last(curves[*a].1)));
    for (row, index) in order.into_iter().enumerate() {
        let (name, curve) = curves[index];
        let y = 16.0 + 24.0 * row as f64;
        let at = |x: f64, y: f64| (px(x) as i32, px(y) as i32);
        let style = line(COLOURS[index % COLOURS.len()], 2.5);
        let ends: Vec<[f64; 2]> = match index < COLOURS.len() {
            true => vec![[0.0, 22.0]],
            false => vec![[0.0, 8.0], [14.0, 22.0]],
        };
        for [from, to] in ends {
            area.draw(&PathElement::new([at(from, y), at(to, y)], style))
                .map_err(drawing)?;
        }
        let text = format!("{name}, max {:.0} ms", last(curve));
        let place = Pos::new(HPos::Left, VPos::Center);
        area.draw(&Text::new(text, at(30.0, y), font(14.0, INK).pos(place)))
            .map_err(drawing)?;
    }
    Ok(())
}

/// Draws a line for each fault, with the name of its stage.
fn draw_faults(
    area: &Area<'_>,
    chart: &mut Chart<'_, '_>,
    figures: &Figures,
    range_ms: &Range<f64>,
) -> Result<(), PlotError> {
    let (bottom, top) = (range_ms.start.log10(), range_ms.end.log10());
    let of_stages = figures.faults.iter().map(|fault| {
        let verb = match fault.kind {
            FaultKind::Stop => "stop",
            FaultKind::Kill => "kill",
        };
        (fault.at_s, format!("{verb} {}", fault.stage))
    });
    let of_others = figures.witness_faults.iter();
    let of_others = of_others.map(|fault| (fault.at_s, fault.name()));
    for (index, (x, name)) in of_stages.chain(of_others).enumerate() {
        let drawn =
            chart.draw_series([PathElement::new([(x, bottom), (x, top)], line(FAULT, 1.5))]);
        drawn.map(drop).map_err(drawing)?;
        let place = Pos::new(HPos::Left, VPos::Top);
        // Neighbours at different heights.
        let down = 4 + 18 * (index % 3) as i32;
        label(area, chart, (x, top), (5, down), &name, place)?;
    }
    Ok(())
}
