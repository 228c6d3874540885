//! A map as one picture, with the trajectory in it.

mod canvas;
mod ground;

use gyre_geometry::Pose;
use nalgebra::Point2;

use crate::{MapError, TileSource, pixels, strips};
use canvas::{Canvas, Colour, View};
use ground::Ground;

const TRAJECTORY: Colour = [86, 196, 255];
const ODOMETRY: Colour = [150, 158, 172];
const LOOPS: Colour = [255, 96, 160];
const START: Colour = [120, 230, 130];
const TEXT: Colour = [220, 224, 232];

/// What is drawn over a map, all in the map frame.
#[derive(Clone, Copy, Debug, Default)]
pub struct Overlay<'a> {
    /// The trajectory by which the map was drawn.
    pub trajectory: &'a [Pose],
    /// The trajectory by odometry alone, drawn thin; empty where it is the same.
    pub odometry: &'a [Pose],
    /// Both ends of each loop.
    pub loops: &'a [[Point2<f64>; 2]],
}

/// Returns the picture of a map as a PNG file: at most 4,096 pixels a side and a footer, x to the right, with the start and its heading, a scale bar and a legend.
///
/// # Errors
/// A tile that cannot be read, and a map that is empty or too large.
pub fn map_png(source: &mut impl TileSource, overlay: &Overlay<'_>) -> Result<Vec<u8>, MapError> {
    let extent = strips::extent(source, "a picture")?;
    let ground = Ground::read(source, &extent)?;
    let mut canvas = Canvas::over(&ground)?;
    let view = canvas.view();
    draw_paths(&mut canvas, &view, overlay);
    draw_footer(&mut canvas, overlay);
    pixels::encode(canvas.width(), png::ColorType::Rgb, &canvas.rgb())
}

fn draw_paths(canvas: &mut Canvas, view: &View, overlay: &Overlay<'_>) {
    let path = |poses: &[Pose]| -> Vec<(f32, f32)> {
        let places = poses
            .iter()
            .map(|pose| Point2::from(pose.translation.vector));
        places.map(|place| view.pixel(&place)).collect()
    };
    canvas.line(&path(overlay.odometry), ODOMETRY, 1.0);
    canvas.line(&path(overlay.trajectory), TRAJECTORY, 1.7);
    for ends in overlay.loops {
        canvas.line(&ends.map(|end| view.pixel(&end)), LOOPS, 1.0);
    }
    if let Some(first) = overlay.trajectory.first() {
        let start = view.pixel(&Point2::from(first.translation.vector));
        // The picture's y axis points down.
        let heading = first.rotation.angle() as f32;
        canvas.arrow(start, (heading.cos(), -heading.sin()), START);
    }
}

fn draw_footer(canvas: &mut Canvas, overlay: &Overlay<'_>) {
    let mut at = canvas.scale_bar(TEXT);
    let loops = format!("{} loops", overlay.loops.len());
    let entries = [
        (!overlay.trajectory.is_empty(), TRAJECTORY, "trajectory"),
        (!overlay.odometry.is_empty(), ODOMETRY, "odometry"),
        (!overlay.loops.is_empty(), LOOPS, &loops),
        (
            !overlay.trajectory.is_empty(),
            START,
            "start, first heading",
        ),
    ];
    for (_, colour, label) in entries.into_iter().filter(|(is_drawn, ..)| *is_drawn) {
        at = canvas.entry(at, colour, label, TEXT);
    }
}
