//! Errors over time with the 3-sigma bands of their covariance.

use std::ops::Range;

use plotters::prelude::*;

use super::{PlotError, canvas::*};
use crate::{BandSample, Bands, TruthSigma};

/// Size of the document, px: the header and three panels of equal height, the last with the time
/// axis.
const SIZE: (u32, u32) = (900, HEADER + 3 * PANEL + TIME_AXIS);
const PANEL: u32 = 220;
const TIME_AXIS: u32 = 56;
/// Half the width of a band, in standard deviations.
const SIGMAS: f64 = 3.0;
/// Margin above and below, as a share of the largest value.
const HEADROOM: f64 = 0.08;
/// The colour of a band: the colour of the estimate, pale.
const BAND: RGBColor = RGBColor(205, 226, 243);

/// Returns the plot as an SVG document: the errors in x, y and yaw over time, each with its 3-sigma
/// band.
pub fn bands_svg(bands: &Bands) -> Result<String, PlotError> {
    let last = bands
        .chains
        .iter()
        .flatten()
        .map(|sample| sample.time_s)
        .reduce(f64::max)
        .ok_or(PlotError::Empty)?;
    let legend = [
        Entry {
            label: "estimate - ground truth",
            symbol: Symbol::Line(line(ESTIMATE, 2.0)),
        },
        Entry {
            label: "+-3 sigma",
            symbol: Symbol::Area(BAND),
        },
    ];
    let panels = [
        Panel::new(bands, "x (m)", 0, 1.0),
        Panel::new(bands, "y (m)", 1, 1.0),
        Panel::new(bands, "yaw (deg)", 2, 1f64.to_degrees()),
    ];
    document(SIZE, |area| {
        header(
            area,
            "Error over time with 3-sigma bands",
            &caption(bands),
            &legend,
        )?;
        let mut rest = area.split_vertically(px(f64::from(HEADER))).1;
        for (index, panel) in panels.iter().enumerate() {
            let (this, below) = rest.split_vertically(px(f64::from(PANEL)));
            let is_last = index + 1 == panels.len();
            draw_panel(
                if is_last { &rest } else { &this },
                panel,
                0.0..last,
                is_last,
            )?;
            rest = below;
        }
        Ok(())
    })
}

fn caption(bands: &Bands) -> String {
    let [x, y, yaw] = bands.inside_percent(SIGMAS);
    let inside = format!(
        "aligned with the ground truth at the start; within the band: x {x:.0} %, y {y:.0} %, yaw {yaw:.0} %"
    );
    match bands.truth_sigma {
        sigma if sigma == TruthSigma::default() => inside,
        sigma => format!("{inside}; ground truth {sigma}"),
    }
}

/// One of the three diagrams.
struct Panel {
    y_desc: &'static str,
    chains: Vec<Vec<Point>>,
}

/// Error and half the band's width, in the panel's unit.
#[derive(Clone, Copy)]
struct Point {
    time_s: f64,
    error: f64,
    band: f64,
}

impl Panel {
    /// The panel of one component (x, y, yaw) of the error; `scale` units of the panel are one SI
    /// unit.
    fn new(bands: &Bands, y_desc: &'static str, part: usize, scale: f64) -> Self {
        let point = |s: &BandSample| Point {
            time_s: s.time_s,
            error: scale * s.error[part],
            band: SIGMAS * scale * s.sigma[part],
        };
        Self {
            y_desc,
            chains: bands
                .chains
                .iter()
                .map(|chain| chain.iter().map(point).collect())
                .collect(),
        }
    }

    /// Returns a range that is symmetric about zero and contains all errors and bands.
    fn range(&self) -> Range<f64> {
        let largest = self
            .chains
            .iter()
            .flatten()
            .map(|p| p.error.abs().max(p.band))
            .fold(0.0, f64::max);
        let top = if largest > 1e-9 {
            (1.0 + HEADROOM) * largest
        } else {
            1.0
        };
        -top..top
    }
}

fn draw_panel(
    area: &Area<'_>,
    panel: &Panel,
    time_s: Range<f64>,
    with_time_axis: bool,
) -> Result<(), PlotError> {
    let mut builder = within_margins(area, 16.0);
    if with_time_axis {
        builder.set_label_area_size(LabelAreaPosition::Bottom, px(f64::from(TIME_AXIS)));
    }
    let mut chart = builder
        .build_cartesian_2d(time_s.clone(), panel.range())
        .map_err(drawing)?;
    for chain in &panel.chains {
        chart.draw_series([band(chain)]).map_err(drawing)?;
    }
    let x_desc = with_time_axis.then_some("time (s)");
    axes(&mut chart, [10, 5], x_desc, panel.y_desc)?;
    let ends = [(time_s.start, 0.0), (time_s.end, 0.0)];
    curve(&mut chart, ends, line(TRUTH, 1.0))?;
    for chain in &panel.chains {
        let errors = chain.iter().map(|p| (p.time_s, p.error));
        curve(&mut chart, errors, line(ESTIMATE, 2.0))?;
    }
    Ok(())
}

/// Returns the area between both limits.
fn band(chain: &[Point]) -> Polygon<(f64, f64)> {
    let upper = chain.iter().map(|p| (p.time_s, p.band));
    let lower = chain.iter().rev().map(|p| (p.time_s, -p.band));
    Polygon::new(upper.chain(lower).collect::<Vec<_>>(), BAND.filled())
}
