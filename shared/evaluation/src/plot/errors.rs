//! Errors over distance.

use plotters::prelude::*;

use super::{PlotError, canvas::*};
use crate::{Evaluation, Kitti, Rpe};

/// Size of the document, px: two panels of equal height below the header.
const SIZE: (u32, u32) = (900, 640);
/// Margin above the largest error, as a share of it.
const HEADROOM: f64 = 0.12;

/// Returns the plot as an SVG document: the KITTI errors over segment length, or, without them, the
/// RPE over the distance travelled.
pub fn errors_svg(evaluation: &Evaluation) -> Result<String, PlotError> {
    match (&evaluation.kitti, &evaluation.rpe) {
        (Some(kitti), _) => by_length(kitti),
        (None, Some(rpe)) => by_pair(rpe),
        (None, None) => Err(PlotError::Empty),
    }
}

fn by_length(kitti: &Kitti) -> Result<String, PlotError> {
    let points = |value: fn(&crate::kitti::KittiLength) -> f64| -> Vec<(f64, f64)> {
        kitti
            .by_length
            .iter()
            .map(|l| (l.length_m, value(l)))
            .collect()
    };
    let caption = format!(
        "mean over {} segments, step {}: {:.2} %, {:.2} deg/100 m (dashed)",
        kitti.segments, kitti.step, kitti.translation_percent, kitti.rotation_deg_per_100m
    );
    let longest = kitti.by_length.last().map_or(100.0, |l| l.length_m);
    let panel = |y_desc, values, mean| Panel {
        x_desc: "segment length (m)",
        y_desc,
        values,
        mean: Some(mean),
        x: 50.0..longest + 50.0,
    };
    draw(
        "KITTI errors over segment length",
        &caption,
        [
            panel(
                "translation (%)",
                points(|l| l.translation_percent),
                kitti.translation_percent,
            ),
            panel(
                "rotation (deg/100 m)",
                points(|l| l.rotation_deg_per_100m),
                kitti.rotation_deg_per_100m,
            ),
        ],
    )
}

fn by_pair(rpe: &Rpe) -> Result<String, PlotError> {
    let points = |value: fn(&crate::PairError) -> f64| -> Vec<(f64, f64)> {
        rpe.pairs.iter().map(|p| (p.distance_m, value(p))).collect()
    };
    let caption = format!(
        "{} pairs, path too short for segments of 100 m; rmse {:.3} m, {:.3} deg (dashed)",
        rpe.pairs.len(),
        rpe.translation_rmse_m,
        rpe.rotation_rmse_deg
    );
    let end = rpe.pairs.last().map_or(0.0, |p| p.distance_m).max(1.0);
    let panel = |y_desc, values, mean| Panel {
        x_desc: "distance travelled (m)",
        y_desc,
        values,
        mean: Some(mean),
        x: 0.0..1.03 * end,
    };
    draw(
        "Relative pose error over distance",
        &caption,
        [
            panel(
                "translation (m)",
                points(|p| p.translation_m),
                rpe.translation_rmse_m,
            ),
            panel(
                "rotation (deg)",
                points(|p| p.rotation_deg.abs()),
                rpe.rotation_rmse_deg,
            ),
        ],
    )
}

/// One of the two diagrams.
struct Panel {
    x_desc: &'static str,
    y_desc: &'static str,
    values: Vec<(f64, f64)>,
    /// Drawn as a dashed line.
    mean: Option<f64>,
    x: std::ops::Range<f64>,
}

fn draw(title: &str, caption: &str, panels: [Panel; 2]) -> Result<String, PlotError> {
    document(SIZE, |area| {
        header(area, title, caption, &[])?;
        let below_header = area.split_vertically(px(f64::from(HEADER))).1;
        for (area, panel) in below_header.split_evenly((2, 1)).iter().zip(&panels) {
            draw_panel(area, panel)?;
        }
        Ok(())
    })
}

fn draw_panel(area: &Area<'_>, panel: &Panel) -> Result<(), PlotError> {
    let largest = panel.values.iter().map(|v| v.1).fold(0.0, f64::max);
    // An estimate without error still needs an axis.
    let top = if largest > 1e-9 {
        (1.0 + HEADROOM) * largest
    } else {
        1.0
    };
    let mut chart = chart(
        area,
        panel.x.clone(),
        0.0..top,
        [panel.x_desc, panel.y_desc],
    )?;
    if let Some(mean) = panel.mean {
        let ends = [(panel.x.start, mean), (panel.x.end, mean)];
        chart
            .draw_series(DashedLineSeries::new(
                ends,
                px(6.0),
                px(5.0),
                line(MARK, 1.5),
            ))
            .map_err(drawing)?;
    }
    let values = panel.values.iter().copied();
    curve(&mut chart, values, line(ESTIMATE, 2.0))?;
    // Dots as long as they do not overlap.
    if panel.values.len() <= 60 {
        let dot = |&at: &(f64, f64)| Circle::new(at, px(4.0), ESTIMATE.filled());
        chart
            .draw_series(panel.values.iter().map(dot))
            .map_err(drawing)?;
    }
    Ok(())
}
