//! Errors over distance.

use std::ops::Range;

use plotters::prelude::*;

use super::{EvaluationError, canvas::*, no_pose};
use crate::evaluation::{Evaluation, Kitti, Rpe};

/// Size of the document, px: two panels of equal height below the header.
const SIZE: (u32, u32) = (900, 640);
const HEADROOM: f64 = 0.12;

/// The errors of translation and of rotation, each with a description, points and a mean, which is
/// drawn as a dashed line.
type Panels = [(&'static str, Vec<(f64, f64)>, f64); 2];

/// Returns the plot as an SVG document: the KITTI errors over segment length, or, without them, the
/// RPE over the distance travelled.
pub fn errors_svg(evaluation: &Evaluation) -> Result<String, EvaluationError> {
    match (&evaluation.kitti, &evaluation.rpe) {
        (Some(kitti), _) => by_length(kitti),
        (None, Some(rpe)) => by_pair(rpe),
        (None, None) => Err(no_pose()),
    }
}

fn by_length(kitti: &Kitti) -> Result<String, EvaluationError> {
    let (translation, rotation) = (kitti.translation_percent, kitti.rotation_deg_per_100m);
    let caption = format!(
        "mean over {} segments, step {}: {translation:.2} %, {rotation:.2} deg/100 m (dashed)",
        kitti.segments, kitti.step
    );
    let lengths = || kitti.by_length.iter();
    let translations = lengths().map(|l| (l.length_m, l.translation_percent));
    let rotations = lengths().map(|l| (l.length_m, l.rotation_deg_per_100m));
    let longest = lengths().last().map_or(100.0, |l| l.length_m);
    let title = "KITTI errors over segment length";
    draw(
        [title, &caption, "segment length (m)"],
        50.0..longest + 50.0,
        [
            ("translation (%)", translations.collect(), translation),
            ("rotation (deg/100 m)", rotations.collect(), rotation),
        ],
    )
}

fn by_pair(rpe: &Rpe) -> Result<String, EvaluationError> {
    let (translation, rotation) = (rpe.translation_rmse_m, rpe.rotation_rmse_deg);
    let caption = format!(
        "{} pairs, path too short for segments of 100 m; rmse {translation:.3} m, {rotation:.3} deg (dashed)",
        rpe.pairs.len()
    );
    let pairs = || rpe.pairs.iter();
    let translations = pairs().map(|p| (p.distance_m, p.translation_m));
    let rotations = pairs().map(|p| (p.distance_m, p.rotation_deg.abs()));
    let end = pairs().last().map_or(0.0, |p| p.distance_m).max(1.0);
    let title = "Relative pose error over distance";
    draw(
        [title, &caption, "distance travelled (m)"],
        0.0..1.03 * end,
        [
            ("translation (m)", translations.collect(), translation),
            ("rotation (deg)", rotations.collect(), rotation),
        ],
    )
}

fn draw(
    [title, caption, x_desc]: [&str; 3],
    x: Range<f64>,
    panels: Panels,
) -> Result<String, EvaluationError> {
    document(SIZE, |area| {
        header(area, title, caption, &[])?;
        let below_header = area.split_vertically(px(f64::from(HEADER))).1;
        for (area, (y_desc, values, mean)) in below_header.split_evenly((2, 1)).iter().zip(panels) {
            let largest = values.iter().map(|v| v.1).fold(0.0, f64::max);
            // An estimate without error still needs an axis.
            let top = match largest > 1e-9 {
                true => (1.0 + HEADROOM) * largest,
                false => 1.0,
            };
            let mut chart = chart(area, [16, 46], x.clone(), 0.0..top)?;
            axes(&mut chart, [10, 5], Some(x_desc), y_desc)?;
            let ends = [(x.start, mean), (x.end, mean)];
            let dashed = DashedLineSeries::new(ends, px(6.0), px(5.0), line(MARK, 1.5));
            chart.draw_series(dashed).map_err(drawing)?;
            curve(&mut chart, values.iter().copied(), line(ESTIMATE, 2.0))?;
            // Dots as long as they do not overlap.
            if values.len() <= 60 {
                let dot = |&at: &(f64, f64)| Circle::new(at, px(4.0), ESTIMATE.filled());
                chart.draw_series(values.iter().map(dot)).map_err(drawing)?;
            }
        }
        Ok(())
    })
}
