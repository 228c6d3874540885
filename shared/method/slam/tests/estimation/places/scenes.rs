//! Drawn places: points at known positions.

use gyre_geometry::{Pose, SparsePoint, Twist};
use gyre_matching::Submap;
use gyre_slam::estimation::places::{Describer, Descriptor};
use nalgebra::Point2;
use rand::{Rng, SeedableRng};
use rand_chacha::ChaCha8Rng;

/// Walls and posts within 75 m.
pub fn place(seed: u64) -> Vec<[f64; 2]> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut points = Vec::new();
    for _ in 0..40 {
        let start = [0, 1].map(|_| random.random_range(-60.0..60.0));
        let angle: f64 = random.random_range(-3.0..3.0);
        let length = random.random_range(0.0..15.0_f64);
        let steps = (length / 0.3) as usize;
        points.extend((0..=steps).map(|k| {
            let along = 0.3 * k as f64;
            [
                start[0] + along * angle.cos(),
                start[1] + along * angle.sin(),
            ]
        }));
    }
    points
}

pub fn seen(place: &[[f64; 2]], sensor: &Pose) -> Submap {
    let points: Vec<SparsePoint> = place
        .iter()
        .map(|at| {
            let at = sensor.inverse() * Point2::from(*at);
            [at.x as f32, at.y as f32, 0.0, 0.7, 0.0].into()
        })
        .collect();
    let mut submap = Submap::default();
    submap.start(&points, &Twist::default());
    submap
}

/// The descriptor of a place from its middle.
pub fn described(seed: u64) -> Descriptor {
    describe(&seen(&place(seed), &Pose::identity()))
}

pub fn describe(submap: &Submap) -> Descriptor {
    let mut descriptor = Descriptor::default();
    Describer::new().describe(submap, &mut descriptor);
    descriptor
}
