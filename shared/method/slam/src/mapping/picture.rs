//! A map as one picture, with the trajectory in it.

mod canvas;
mod ground;

use gyre_geometry::Pose;
use nalgebra::{Point2, Vector2};

use crate::mapping::{MapError, MapOptions, TileExtent, TileSource, pixels};
use canvas::{Canvas, Colour, Pen, View};
use ground::Ground;

const TRAJECTORY: Colour = [86, 196, 255];
const ODOMETRY: Colour = [150, 158, 172];
const LOOPS: Colour = [236, 40, 132];
const START: Colour = [120, 230, 130];
const TEXT: Colour = [220, 224, 232];

/// Loops have a pale rim wider than the trajectory, under which many lie: they join places of one
/// lane.
const LOOPS_RIM: Pen = Pen {
    colour: LOOPS,
    width: 5.0,
    opacity: 0.4,
};
/// Side of a picture that is legible at once, px.
const LEGIBLE_SIDE: f64 = 2048.0;
/// Side of the largest cells that are chosen for a picture, m: larger pixels are made of several
/// cells.
const MAX_CELL_M: f64 = 3.2;

#[derive(Clone, Copy, Debug, Default)]
pub struct Overlay<'a> {
    /// The trajectory that was used to draw the map, or one through it, in pieces that are not
    /// joined.
    pub trajectory: &'a [&'a [Pose]],
    /// The trajectory by odometry alone, drawn thin; empty where it is the same.
    pub odometry: &'a [Pose],
    pub loops: &'a [[Point2<f64>; 2]],
}

/// Returns options with the smallest cells, doubled from the default, that give a picture of the
/// map around `poses` at most 2,048 cells a side; cells are at most 3.2 m.
pub fn legible(options: MapOptions, poses: &[Pose]) -> MapOptions {
    let finite = || {
        let places = poses.iter().map(|pose| pose.translation.vector);
        places.filter(|place| place.iter().all(|at| at.is_finite()))
    };
    let most = finite().fold(Vector2::repeat(f64::MIN), |a, b| a.sup(&b));
    let least = finite().fold(Vector2::repeat(f64::MAX), |a, b| a.inf(&b));
    let side_m = (most - least).max() + 2.0 * options.reach_m;
    let mut cell_m = MapOptions::default().cell_m;
    while cell_m < MAX_CELL_M && side_m > LEGIBLE_SIDE * cell_m {
        cell_m *= 2.0;
    }
    MapOptions { cell_m, ..options }
}

/// Returns the picture of a map as a PNG file: at most 4,096 pixels a side and a footer, x to the
/// right, with the start and its heading, a scale bar with the metres of a pixel, and a legend.
/// Memory: 250 MB at most.
pub fn map_png(source: &mut impl TileSource, overlay: &Overlay<'_>) -> Result<Vec<u8>, MapError> {
    let extent = TileExtent::of(&source.tiles()).ok_or(MapError::Empty)?;
    let ground = Ground::read(source, &extent)?;
    let mut canvas = Canvas::over(&ground)?;
    let view = canvas.view;
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
    let loops = overlay.loops.iter();
    let loops = loops.map(|ends| ends.map(|end| view.pixel(&end)));
    canvas.lines(loops.clone(), LOOPS_RIM);
    canvas.lines(loops, Pen::opaque(LOOPS, 1.0));
    canvas.lines([path(overlay.odometry)], Pen::opaque(ODOMETRY, 1.0));
    let pieces = overlay.trajectory.iter().map(|piece| path(piece));
    canvas.lines(pieces, Pen::opaque(TRAJECTORY, 1.7));
    if let Some(first) = overlay.trajectory.iter().find_map(|piece| piece.first()) {
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
        (!overlay.loops.is_empty(), LOOPS, loops.as_str()),
        (!overlay.trajectory.is_empty(), START, "start"),
    ];
    for (_, colour, label) in entries.into_iter().filter(|(is_drawn, ..)| *is_drawn) {
        at = canvas.entry(at, colour, label, TEXT);
    }
}
