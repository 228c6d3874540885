//! The curves of several recordings, one diagram a statistic.

use std::ops::Range;

use gyre_evaluation::plot::{PlotError, canvas::*};
use plotters::prelude::*;

use super::{correlation::Curve, recording::Recording};

/// Size of a document, px.
const SIZE: (u32, u32) = (900, 480);
/// Colours and labels, recording by recording.
const STYLES: [(RGBColor, &str); 3] =
    [(ESTIMATE, "simulated"), (INK, "real"), (MARK, "other real")];
/// Decades of shares that are drawn: less than this is a bin in a scan or none at all.
const MIN_LOG_SHARE: f64 = -6.0;

type Points = Vec<(f64, f64)>;

/// A diagram: its file, title, axes and curve.
type Diagram = (
    &'static str,
    &'static str,
    [&'static str; 2],
    fn(&Recording) -> Points,
);

const DIAGRAMS: [Diagram; 4] = [
    (
        "histogram",
        "Histogram of power",
        ["power (counts)", "log10 of the share of cells"],
        log_shares,
    ),
    (
        "power-against-range",
        "Mean power against range",
        ["range (m)", "mean power (counts)"],
        |recording| {
            let statistics = &recording.statistics;
            let cells = statistics.mean_power.iter().enumerate();
            cells
                .map(|(cell, power)| (statistics.grid.centre_m(cell), *power))
                .collect()
        },
    ),
    (
        "correlation-in-range",
        "Autocorrelation in range",
        ["lag (m)", "correlation"],
        |recording| points(&recording.statistics.range_correlation),
    ),
    (
        "correlation-in-azimuth",
        "Autocorrelation in azimuth",
        ["lag (deg)", "correlation"],
        |recording| points(&recording.statistics.azimuth_correlation),
    ),
];

/// Draws the curves of a simulated, a real and, if it is there, another real recording over each other. Returns names of files and SVG
/// documents.
///
/// # Errors
/// [`PlotError::Draw`].
pub fn curves(recordings: &[&Recording]) -> Result<Vec<(&'static str, String)>, PlotError> {
    let draw = |diagram: &Diagram| Ok((diagram.0, draw(diagram, recordings)?));
    DIAGRAMS.iter().map(draw).collect()
}

fn draw(
    (_, title, axes, points): &Diagram,
    recordings: &[&Recording],
) -> Result<String, PlotError> {
    let curves: Vec<Points> = recordings
        .iter()
        .map(|recording| points(recording))
        .collect();
    let all = || curves.iter().flatten();
    let (x, y) = (
        range(all().map(|point| point.0)),
        range(all().map(|point| point.1)),
    );
    let styles = || {
        recordings
            .iter()
            .zip(STYLES)
            .map(|(_, (colour, label))| (line(colour, 2.0), label))
    };
    let entry = |(style, label)| Entry {
        label,
        symbol: Symbol::Line(style),
    };
    let legend: Vec<Entry<'_>> = styles().map(entry).collect();
    document(SIZE, |area| {
        header(area, title, &caption(recordings), &legend)?;
        let below_header = area.split_vertically(px(f64::from(HEADER))).1;
        let mut chart = chart(&below_header, x, y, *axes)?;
        for (curve, (style, _)) in curves.iter().zip(styles()) {
            let series = LineSeries::new(curve.iter().copied(), style);
            chart.draw_series(series).map_err(drawing)?;
        }
        Ok(())
    })
}

fn points(curve: &Curve) -> Points {
    let lags = curve.values.iter().enumerate();
    lags.map(|(lag, value)| (lag as f64 * curve.step, *value))
        .collect()
}

/// Powers that do not occur are left out.
fn log_shares(recording: &Recording) -> Points {
    let histogram = &recording.statistics.histogram;
    let total = histogram.total() as f64;
    let counts = histogram.counts().iter().enumerate();
    let shares = counts.map(|(power, count)| (power as f64, (*count as f64 / total).log10()));
    shares
        .filter(|(_, log_share)| *log_share > MIN_LOG_SHARE)
        .collect()
}

/// From the least to the largest, and a little more than nothing.
fn range(values: impl Iterator<Item = f64> + Clone) -> Range<f64> {
    let least = values.clone().fold(f64::INFINITY, f64::min);
    let most = values.fold(f64::NEG_INFINITY, f64::max);
    if least < most { least..most } else { 0.0..1.0 }
}

fn caption(recordings: &[&Recording]) -> String {
    let scans = |recording: &&Recording| {
        format!("{} scans of {}", recording.statistics.scans, recording.name)
    };
    let scans: Vec<String> = recordings.iter().map(scans).collect();
    scans.join(", ")
}
