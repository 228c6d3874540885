//! The curves of several recordings, one diagram a statistic.

use std::ops::Range;

use gyre_evaluation::plot::{PlotError, canvas::*};
use plotters::prelude::*;

use crate::realism::Recording;

/// Size of a document, px.
const SIZE: (u32, u32) = (900, 480);
/// Colours, recording by recording.
const COLOURS: [RGBColor; 3] = [ESTIMATE, INK, MARK];
/// What stands for them in the legend.
const LABELS: [&str; 3] = ["simulated", "real", "other real"];
/// Decades of shares that are drawn: less than this is a bin in a scan or none at all.
const LEAST_LOG_SHARE: f64 = -6.0;

/// A diagram's name, as that of a file, and its SVG document.
pub type Drawing = (&'static str, String);

/// The curves of a simulated, a real and, if it is there, another real recording, laid over each other: the histogram, the mean power against range, both autocorrelations.
///
/// # Errors
/// [`PlotError::Draw`].
pub fn curves(recordings: &[&Recording]) -> Result<Vec<Drawing>, PlotError> {
    DIAGRAMS
        .iter()
        .map(|diagram| Ok((diagram.name, diagram.draw(recordings)?)))
        .collect()
}

struct Diagram {
    name: &'static str,
    title: &'static str,
    x_desc: &'static str,
    y_desc: &'static str,
    points: fn(&Recording) -> Vec<(f64, f64)>,
}

static DIAGRAMS: [Diagram; 4] = [
    Diagram {
        name: "histogram",
        title: "Histogram of power",
        x_desc: "power (counts)",
        y_desc: "log10 of the share of cells",
        points: log_shares,
    },
    Diagram {
        name: "power-against-range",
        title: "Mean power against range",
        x_desc: "range (m)",
        y_desc: "mean power (counts)",
        points: |recording| {
            let statistics = &recording.statistics;
            let cells = statistics.mean_power.iter().enumerate();
            cells
                .map(|(cell, power)| (statistics.grid.centre_m(cell), *power))
                .collect()
        },
    },
    Diagram {
        name: "correlation-in-range",
        title: "Autocorrelation in range",
        x_desc: "lag (m)",
        y_desc: "correlation",
        points: |recording| points(&recording.statistics.range_correlation),
    },
    Diagram {
        name: "correlation-in-azimuth",
        title: "Autocorrelation in azimuth",
        x_desc: "lag (deg)",
        y_desc: "correlation",
        points: |recording| points(&recording.statistics.azimuth_correlation),
    },
];

fn points(curve: &crate::realism::Curve) -> Vec<(f64, f64)> {
    curve
        .values
        .iter()
        .enumerate()
        .map(|(lag, value)| (lag as f64 * curve.step, *value))
        .collect()
}

/// Powers that do not occur are left out.
fn log_shares(recording: &Recording) -> Vec<(f64, f64)> {
    let histogram = &recording.statistics.histogram;
    let total = histogram.total() as f64;
    let log_share = |count: &u64| (*count as f64 / total).log10();
    let shares = histogram
        .counts()
        .iter()
        .enumerate()
        .map(|(power, count)| (power as f64, log_share(count)));
    shares
        .filter(|(_, log_share)| *log_share > LEAST_LOG_SHARE)
        .collect()
}

impl Diagram {
    fn draw(&self, recordings: &[&Recording]) -> Result<String, PlotError> {
        let curves: Vec<Vec<(f64, f64)>> = recordings
            .iter()
            .map(|recording| (self.points)(recording))
            .collect();
        let all = || curves.iter().flatten();
        let (x, y) = (
            range(all().map(|point| point.0)),
            range(all().map(|point| point.1)),
        );
        let entry = |((_, label), colour)| Entry {
            label,
            symbol: Symbol::Line(line(colour, 2.0)),
        };
        let legend: Vec<Entry<'_>> = recordings
            .iter()
            .zip(LABELS)
            .zip(COLOURS)
            .map(entry)
            .collect();
        document(SIZE, |area| {
            header(area, self.title, &caption(recordings), &legend)?;
            let below_header = area.split_vertically(px(f64::from(HEADER))).1;
            self.draw_chart(&below_header, &curves, x, y)
        })
    }

    fn draw_chart(
        &self,
        area: &Area<'_>,
        curves: &[Vec<(f64, f64)>],
        x: Range<f64>,
        y: Range<f64>,
    ) -> Result<(), PlotError> {
        let mut chart = chart(area, x, y, [self.x_desc, self.y_desc])?;
        for (curve, colour) in curves.iter().zip(COLOURS) {
            chart
                .draw_series(LineSeries::new(curve.iter().copied(), line(colour, 2.0)))
                .map_err(drawing)?;
        }
        Ok(())
    }
}

/// From the least to the largest, and a little more than nothing.
fn range(values: impl Iterator<Item = f64>) -> Range<f64> {
    let (least, most) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(least, most), v| {
        (least.min(v), most.max(v))
    });
    if least < most { least..most } else { 0.0..1.0 }
}

/// What the curves were measured on.
fn caption(recordings: &[&Recording]) -> String {
    let Some(first) = recordings.first() else {
        return String::new();
    };
    let grid = first.statistics.grid;
    let scans = |recording: &&Recording| {
        format!("{} scans of {}", recording.statistics.scans, recording.name)
    };
    let scans: Vec<String> = recordings.iter().map(scans).collect();
    format!(
        "{}; cells of {:.4} m up to {:.1} m",
        scans.join(", "),
        grid.resolution_m,
        grid.range_m()
    )
}
