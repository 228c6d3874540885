//! Errors over time with the 3-sigma bands of their covariance.

use std::ops::Range;

use plotters::prelude::*;

use super::{EvaluationError, canvas::*, no_pose};
use crate::evaluation::{BandSample, Bands, TruthSigma};

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
pub fn bands_svg(bands: &Bands) -> Result<String, EvaluationError> {
    let times_s = bands.chains.iter().flatten().map(|sample| sample.time_s);
    let last = times_s.reduce(f64::max).ok_or_else(no_pose)?;
    let error = ("estimate - ground truth", Symbol::Line(line(ESTIMATE, 2.0)));
    let legend = [error, ("+-3 sigma", Symbol::Area(BAND))];
    let title = "Error over time with 3-sigma bands";
    document(SIZE, |area| {
        header(area, title, &caption(bands), &legend)?;
        let mut rest = area.split_vertically(px(f64::from(HEADER))).1;
        for (part, y_desc) in ["x (m)", "y (m)", "yaw (deg)"].into_iter().enumerate() {
            let (this, below) = rest.split_vertically(px(f64::from(PANEL)));
            // The last panel has the time axis.
            let (area, x_desc) = match part {
                2 => (&rest, Some("time (s)")),
                _ => (&this, None),
            };
            draw_panel(area, &chains(bands, part), 0.0..last, x_desc, y_desc)?;
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

/// A time, s, and the error and half the band's width then, m or degrees.
type Point = [f64; 3];

/// Returns one component (x, y, yaw) of the errors in each chain.
fn chains(bands: &Bands, part: usize) -> Vec<Vec<Point>> {
    let scale = if part == 2 { 1f64.to_degrees() } else { 1.0 };
    let point = |s: &BandSample| {
        let (error, sigma) = (scale * s.error[part], scale * s.sigma[part]);
        [s.time_s, error, SIGMAS * sigma]
    };
    let chains = bands.chains.iter();
    let chains = chains.map(|chain| chain.iter().map(point).collect());
    chains.collect()
}

fn draw_panel(
    area: &Area<'_>,
    chains: &[Vec<Point>],
    time_s: Range<f64>,
    x_desc: Option<&str>,
    y_desc: &str,
) -> Result<(), EvaluationError> {
    let size = |[_, error, band]: &Point| error.abs().max(*band);
    let largest = chains.iter().flatten().map(size).fold(0.0, f64::max);
    let top = match largest > 1e-9 {
        true => (1.0 + HEADROOM) * largest,
        false => 1.0,
    };
    let below = x_desc.map_or(0, |_| TIME_AXIS);
    let mut chart = chart(area, [16, below], time_s.clone(), -top..top)?;
    for chain in chains {
        let upper = chain.iter().map(|[time_s, _, band]| (*time_s, *band));
        let lower = chain.iter().rev().map(|[time_s, _, band]| (*time_s, -band));
        let band = Polygon::new(upper.chain(lower).collect::<Vec<_>>(), BAND.filled());
        chart.draw_series([band]).map_err(drawing)?;
    }
    axes(&mut chart, [10, 5], x_desc, y_desc)?;
    let ends = [(time_s.start, 0.0), (time_s.end, 0.0)];
    curve(&mut chart, ends, line(TRUTH, 1.0))?;
    for chain in chains {
        let errors = chain.iter().map(|[time_s, error, _]| (*time_s, *error));
        curve(&mut chart, errors, line(ESTIMATE, 2.0))?;
    }
    Ok(())
}
