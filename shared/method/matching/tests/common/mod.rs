//! Generated scenes: blurred scatterers whose positions are known before and after a motion.
#![allow(dead_code)]

pub mod scenes;

use gyre_geometry::{Pose, pose, wrap_angle, xy_yaw};
use gyre_matching::{
    MotionMatch, RotationConfig, RotationMatch, RotationSearch, TranslationConfig,
    TranslationSearch,
};
use ndarray::Array2;

/// A pose, m and degrees.
pub fn pose_deg(x_m: f64, y_m: f64, yaw_deg: f64) -> Pose {
    pose(x_m, y_m, yaw_deg.to_radians())
}

/// Returns by how much a match is off, m, m and degrees.
pub fn errors(found: &MotionMatch, motion: &Pose) -> [f64; 3] {
    let [x_m, y_m, yaw_rad] = xy_yaw(motion);
    let turn = wrap_angle(found.yaw_rad - yaw_rad);
    [found.x_m - x_m, found.y_m - y_m, turn.to_degrees()]
}

/// A generator of pseudo-random numbers (SplitMix64, Steele et al. 2014).
pub struct Numbers(pub u64);

impl Numbers {
    fn bits(&mut self) -> u64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        z ^ (z >> 31)
    }

    /// A number in 0..1.
    pub fn next(&mut self) -> f64 {
        (self.bits() >> 11) as f64 / (1_u64 << 53) as f64
    }

    pub fn below(&mut self, end: usize) -> usize {
        (self.bits() % end as u64) as usize
    }

    pub fn within(&mut self, limit: f64) -> f64 {
        limit * (2.0 * self.next() - 1.0)
    }
}

/// Positions (m) and strengths of scatterers within `radius_m` of the earlier sensor.
pub fn scatterers(count: usize, radius_m: f64, seed: u64) -> Vec<([f64; 2], f64)> {
    let mut numbers = Numbers(seed);
    let mut place = || loop {
        let p = [numbers.within(radius_m), numbers.within(radius_m)];
        if p[0].hypot(p[1]) < radius_m {
            return (p, 0.3 + numbers.next());
        }
    };
    (0..count).map(|_| place()).collect()
}

/// Scatterers around a place 15 m ahead and 4 m to the left.
pub fn scene_aside() -> Vec<([f64; 2], f64)> {
    let scene = scatterers(40, 6.0, 3).into_iter();
    scene.map(|([x, y], s)| ([x + 15.0, y + 4.0], s)).collect()
}

/// Draws scatterers as Gaussians of `blur` cells, row 0 far ahead, column 0 far left.
pub fn draw(
    points: impl Iterator<Item = ([f64; 2], f64)>,
    n: usize,
    cell_m: f64,
    blur: f64,
) -> Array2<f32> {
    let mut raster = Array2::zeros((n, n));
    let (middle, reach) = ((n - 1) as f64 / 2.0, (5.0 * blur).ceil() as isize);
    for ([x, y], strength) in points {
        let (row, col) = (middle - x / cell_m, middle - y / cell_m);
        for i in row.round() as isize - reach..=row.round() as isize + reach {
            for j in col.round() as isize - reach..=col.round() as isize + reach {
                if (0..n as isize).contains(&i) && (0..n as isize).contains(&j) {
                    let r2 = (i as f64 - row).powi(2) + (j as f64 - col).powi(2);
                    raster[[i as usize, j as usize]] +=
                        (strength * (-0.5 * r2 / blur.powi(2)).exp()) as f32;
                }
            }
        }
    }
    raster
}

/// The earlier and the later raster of a scene with 150 scatterers, around the sensor and beyond
/// the raster's edge.
pub fn pair(n: usize, cell_m: f64, motion: Pose, seed: u64) -> (Array2<f32>, Array2<f32>) {
    let scene = scatterers(150, 0.75 * n as f64 * cell_m, seed);
    pair_of(&scene, n, cell_m, 1.2, motion)
}

/// The earlier and the later raster of these scatterers.
pub fn pair_of(
    scene: &[([f64; 2], f64)],
    n: usize,
    cell_m: f64,
    blur: f64,
    motion: Pose,
) -> (Array2<f32>, Array2<f32>) {
    let earlier = draw(scene.iter().copied(), n, cell_m, blur);
    let seen = scene
        .iter()
        .map(|&(p, s)| (motion.inverse_transform_point(&p.into()).into(), s));
    (earlier, draw(seen, n, cell_m, blur))
}

pub fn search(
    n: usize,
    cell_m: f64,
    configs: &(RotationConfig, TranslationConfig),
    earlier: &Array2<f32>,
    later: &Array2<f32>,
) -> (RotationMatch, MotionMatch) {
    let mut rotation = RotationSearch::new(n, &configs.0).unwrap();
    let mut translation = TranslationSearch::new(n, cell_m, &configs.1).unwrap();
    let (mut f, mut g) = (rotation.new_spectrum(), rotation.new_spectrum());
    rotation.spectrum(earlier.view(), &mut g).unwrap();
    rotation.spectrum(later.view(), &mut f).unwrap();
    let angle = rotation.search(&f, &g, None).unwrap();
    let motion = translation
        .search(later.view(), earlier.view(), &angle)
        .unwrap();
    (angle, motion)
}
