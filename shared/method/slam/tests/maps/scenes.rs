//! Keyframes with simulated points of a scene.

use gyre_geometry::{Pose, SparsePoint, UncertainMotion, pose};
use gyre_slam::{
    Keyframe,
    mapping::{Cell, Evidence, MapOptions, TILE_CELLS, TileImage, TileIndex, TileSource},
};
use nalgebra::Point2;

/// A wall 20 m to the left of the x axis, a point every 0.1 m.
pub fn wall() -> Vec<Point2<f64>> {
    (-300..300)
        .map(|k| Point2::new(f64::from(k) * 0.1, 20.0))
        .collect()
}

/// The keyframe at `pose` that sees `places` of the map frame, standing.
pub fn keyframe(seq: u64, pose: &Pose, places: &[Point2<f64>]) -> Keyframe {
    let points = places.iter().map(|place| {
        let seen = pose.inverse() * place;
        SparsePoint::from([seen.x as f32, seen.y as f32, 0.0, 1.0, 0.0])
    });
    let mut keyframe = Keyframe::standing(seq, UncertainMotion::identity(), points.collect());
    keyframe.pose.motion = *pose;
    keyframe
}

pub fn drive(count: u64, places: &[Point2<f64>]) -> Vec<(Pose, Keyframe)> {
    (0..count)
        .map(|seq| {
            let at = pose(seq as f64 - 0.5 * count as f64, 0.0, 0.3 * seq as f64);
            (at, keyframe(seq, &at, places))
        })
        .collect()
}

pub fn drawn(drive: &[(Pose, Keyframe)]) -> Evidence {
    drawn_with(&MapOptions::default(), drive)
}

pub fn drawn_with(options: &MapOptions, drive: &[(Pose, Keyframe)]) -> Evidence {
    let mut evidence = Evidence::new(options, &std::env::temp_dir()).unwrap();
    for (pose, keyframe) in drive {
        evidence.draw(keyframe, pose).unwrap();
    }
    evidence
}

pub fn images(evidence: &mut Evidence) -> Vec<(TileIndex, TileImage)> {
    let tiles = evidence.tiles();
    let image = |tile| {
        let mut image = TileImage::default();
        evidence.read(tile, &mut image).unwrap();
        (tile, image)
    };
    tiles.into_iter().map(image).collect()
}

pub fn cell(evidence: &mut Evidence, x_m: f64, y_m: f64) -> Cell {
    let side = TILE_CELLS as f64;
    let [x, y] = [x_m, y_m].map(|at_m| (at_m / evidence.options().cell_m).floor());
    let tile = TileIndex {
        x: (x / side).floor() as i32,
        y: (y / side).floor() as i32,
    };
    let mut image = TileImage::default();
    evidence.read(tile, &mut image).unwrap();
    let [column, row] = [x, y].map(|cell| cell.rem_euclid(side) as usize);
    image.cells[(TILE_CELLS - 1 - row) * TILE_CELLS + column]
}
