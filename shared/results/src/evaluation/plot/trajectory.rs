//! The trajectory seen from above.

use gyre_geometry::Pose;
use plotters::prelude::*;

use super::{EvaluationError, canvas::*, no_pose};
use crate::evaluation::{MatchedPoses, ate, error::ESTIMATE as NAME, matched::require_poses};

const LARGEST: (f64, f64) = (900.0, 720.0);
/// Smallest plotting area, px: the header needs the width.
const SMALLEST: (f64, f64) = (600.0, 260.0);
/// Space for labels left of and below the plotting area, and the margin, px.
const LEFT: u32 = 84;
const BELOW: u32 = 48;
const MARGIN: u32 = 20;
/// Border around the paths, as a share of the larger extent.
const BORDER: f64 = 0.06;
const MIN_EXTENT_M: f64 = 1.0;

/// Returns the plot as an SVG document: the aligned estimate over its ground truth.
pub fn trajectory_svg(matched: &MatchedPoses) -> Result<String, EvaluationError> {
    let ate = ate(matched);
    let rmse_m = ate.rmse_m;
    let align = |pose: &Pose| ate.truth_from_estimate * pose;
    let aligned: Vec<Pose> = matched.estimate().iter().map(align).collect();
    scene_svg(&Scene {
        paths: vec![("estimate", positions(&aligned))],
        truth: Some(positions(matched.truth())),
        title: "Trajectory and ground truth",
        caption: format!("estimate after SE(2) alignment; ATE {rmse_m:.2} m rmse"),
    })
}

/// Returns the plot of a trajectory with this number of poses and this length; only the poses
/// `drawn` are plotted.
pub fn path_svg(drawn: &[Pose], poses: usize, length_m: f64) -> Result<String, EvaluationError> {
    require_poses(NAME, drawn)?;
    scene_svg(&Scene {
        paths: vec![("estimate", positions(drawn))],
        truth: None,
        title: "Trajectory",
        caption: format!("{poses} poses, {length_m:.1} m"),
    })
}

/// Returns the plot of trajectories by their names, in the frame of the ground truth if there is
/// one.
pub fn paths_svg(
    paths: &[(&str, Vec<Pose>)],
    truth: Option<&[Pose]>,
) -> Result<String, EvaluationError> {
    for (_, poses) in paths {
        require_poses(NAME, poses)?;
    }
    let positions = |poses: &[Pose]| positions(poses);
    let title = match paths {
        [_] => "Trajectory",
        _ => "Trajectories",
    };
    scene_svg(&Scene {
        paths: paths
            .iter()
            .map(|(name, poses)| (*name, positions(poses)))
            .collect(),
        truth: truth.map(positions),
        title,
        caption: match truth {
            Some(_) => "after SE(2) alignment to the ground truth".to_owned(),
            None => "each in its own frame".to_owned(),
        },
    })
}

fn scene_svg(scene: &Scene<'_>) -> Result<String, EvaluationError> {
    let paths = scene.paths.iter().flat_map(|(_, path)| path);
    let view = View::around(paths.chain(scene.truth.iter().flatten())).ok_or_else(no_pose)?;
    let size = (
        view.width_px + LEFT + 2 * MARGIN,
        view.height_px + BELOW + HEADER + MARGIN,
    );
    document(size, |area| {
        header(area, scene.title, &scene.caption, &scene.legend())?;
        draw(area, scene, &view)
    })
}

struct Scene<'a> {
    paths: Vec<(&'a str, Vec<(f64, f64)>)>,
    truth: Option<Vec<(f64, f64)>>,
    title: &'static str,
    caption: String,
}

impl Scene<'_> {
    fn legend(&self) -> Vec<Entry<'_>> {
        let entry = |label, style| (label, Symbol::Line(style));
        let truth = self.truth.iter();
        let truth = truth.map(|_| entry("ground truth", line(TRUTH, 4.0)));
        let paths = self.paths.iter().zip(colours());
        let paths = paths.map(|((name, _), colour)| entry(shortened(name), line(colour, 2.0)));
        let start = ("start", Symbol::Dot);
        truth.chain(paths).chain([start]).collect()
    }
}

/// Returns the colours of estimates: distinct also for those who do not see red and green.
fn colours() -> impl Iterator<Item = RGBColor> {
    [
        ESTIMATE,
        RGBColor(0, 158, 115),
        RGBColor(204, 121, 167),
        RGBColor(230, 159, 0),
        RGBColor(86, 180, 233),
    ]
    .into_iter()
    .cycle()
}

/// Letters of a name in the legend.
const LABEL: usize = 19;

/// Returns the end of a name that is too long for the legend.
fn shortened(name: &str) -> &str {
    let start = name.char_indices().rev().nth(LABEL - 1);
    start.map_or(name, |(start, _)| &name[start..])
}

fn positions(poses: &[Pose]) -> Vec<(f64, f64)> {
    let position = |pose: &Pose| (pose.translation.x, pose.translation.y);
    poses.iter().map(position).collect()
}

/// The part of the plane that is shown, at the same scale on both axes.
struct View {
    x_m: (f64, f64),
    y_m: (f64, f64),
    width_px: u32,
    height_px: u32,
}

impl View {
    fn around<'a>(points: impl Iterator<Item = &'a (f64, f64)>) -> Option<Self> {
        let grow = |b: [f64; 4], p: &(f64, f64)| {
            [b[0].min(p.0), b[1].max(p.0), b[2].min(p.1), b[3].max(p.1)]
        };
        let [left, right, low, high] = points.fold(None, |b, p| {
            Some(grow(b.unwrap_or([p.0, p.0, p.1, p.1]), p))
        })?;
        let border = BORDER * (right - left).max(high - low).max(MIN_EXTENT_M);
        let (width_m, height_m) = (right - left + 2.0 * border, high - low + 2.0 * border);
        let px_per_m = (LARGEST.0 / width_m).min(LARGEST.1 / height_m);
        let shown = |extent_m: f64, smallest: f64| (extent_m * px_per_m).max(smallest).round();
        let (width, height) = (shown(width_m, SMALLEST.0), shown(height_m, SMALLEST.1));
        let about = |from: f64, to: f64, px: f64| {
            let (centre, half) = (0.5 * (from + to), 0.5 * px / px_per_m);
            (centre - half, centre + half)
        };
        Some(Self {
            x_m: about(left, right, width),
            y_m: about(low, high, height),
            width_px: width as u32,
            height_px: height as u32,
        })
    }
}

fn draw(area: &Area<'_>, scene: &Scene<'_>, view: &View) -> Result<(), EvaluationError> {
    let below_header = area.split_vertically(px(f64::from(HEADER))).1;
    let (x_m, y_m) = (view.x_m.0..view.x_m.1, view.y_m.0..view.y_m.1);
    let mut chart = chart(&below_header, [MARGIN, BELOW], x_m, y_m)?;
    // One tick in about 90 px on both axes.
    let ticks = [view.width_px, view.height_px].map(|px| (px / 90).max(2) as usize);
    axes(&mut chart, ticks, Some("x (m)"), "y (m)")?;
    if let Some(truth) = &scene.truth {
        curve(&mut chart, truth.iter().copied(), line(TRUTH, 4.0))?;
    }
    for ((_, path), colour) in scene.paths.iter().zip(colours()) {
        curve(&mut chart, path.iter().copied(), line(colour, 2.0))?;
    }
    let starts = scene.paths.iter().filter_map(|(_, path)| path.first());
    let starts = starts.map(|start| dot(*start));
    chart.draw_series(starts).map_err(drawing)?;
    Ok(())
}
