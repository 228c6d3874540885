use gyre_geometry::{Pose, SparsePoint, Twist};
use ndarray::Array2;

use super::points::DeskewedPoints;

/// The points of a keyframe and of the keyframes around it, in its frame.
///
/// Points are deskewed and free of the Doppler shift, so that submaps of opposite passes coincide:
/// with the shift in them they lie a third of a metre apart. Nothing is allocated for as many
/// points as it is planned for.
#[derive(Debug, Default)]
pub struct Submap {
    pub(super) keyframe: DeskewedPoints,
    pub(super) all: DeskewedPoints,
    added: DeskewedPoints,
}

impl Submap {
    pub fn with_capacity(points: usize) -> Self {
        let points = || DeskewedPoints::with_capacity(points);
        Self {
            keyframe: points(),
            all: points(),
            added: points(),
        }
    }

    /// Restarts with the keyframe in the middle. `twist` is its velocity during the sweep.
    pub fn start(&mut self, points: &[SparsePoint], twist: &Twist) {
        self.keyframe.deskew(points, twist);
        self.all.clear();
        self.all.extend(&self.keyframe, &Pose::identity());
    }

    pub fn add(&mut self, points: &[SparsePoint], twist: &Twist, pose: &Pose) {
        self.added.deskew(points, twist);
        self.all.extend(&self.added, pose);
    }

    /// Returns the points in the frame of the middle keyframe: x and y in m, and the weight.
    pub fn points(&self) -> impl Iterator<Item = [f32; 3]> {
        let places = self.all.x_m.iter().zip(&self.all.y_m);
        places
            .zip(&self.all.weight)
            .map(|((x_m, y_m), weight)| [*x_m, *y_m, *weight])
    }

    /// Draws the submap around the middle of `raster`, row 0 far ahead and column 0 far left: each
    /// cell is the sum of the weights of the points in it, each shared bilinearly between four
    /// cells of `cell_m` metres. Points outside are left out.
    pub fn draw(&self, cell_m: f64, raster: &mut Array2<f32>) {
        raster.fill(0.0);
        let last = <[usize; 2]>::from(raster.dim()).map(|cells| cells as f32 - 1.0);
        let per_m = 1.0 / cell_m as f32;
        for [x_m, y_m, weight] in self.points() {
            let (u, v) = (0.5 * last[0] - x_m * per_m, 0.5 * last[1] - y_m * per_m);
            // NaN is not inside.
            if !((0.0..last[0]).contains(&u) && (0.0..last[1]).contains(&v)) {
                continue;
            }
            let (i, j) = (u as usize, v as usize);
            let (across, along) = (u - i as f32, v - j as f32);
            raster[[i, j]] += weight * (1.0 - across) * (1.0 - along);
            raster[[i, j + 1]] += weight * (1.0 - across) * along;
            raster[[i + 1, j]] += weight * across * (1.0 - along);
            raster[[i + 1, j + 1]] += weight * across * along;
        }
    }
}

#[cfg(test)]
mod tests {
    use gyre_geometry::pose;

    use super::*;

    fn point(x_m: f32, y_m: f32) -> SparsePoint {
        [x_m, y_m, 0.0, 0.5, 0.0].into()
    }

    #[test]
    fn a_point_is_drawn_in_the_frame_of_the_middle_keyframe() {
        let mut submap = Submap::default();
        submap.start(&[point(9.0, 9.0)], &Twist::default());
        let quarter = std::f64::consts::FRAC_PI_2;
        // A quarter turn to the left, 2 m ahead: a point 3 m ahead there is 2 m ahead and 3 m to
        // the left here.
        submap.start(&[point(4.0, -1.0)], &Twist::default());
        submap.add(
            &[point(3.0, 0.0), point(f32::NAN, 0.0)],
            &Twist::default(),
            &pose(2.0, 0.0, quarter),
        );
        let mut raster = Array2::from_elem((17, 17), 9.0);
        submap.draw(1.0, &mut raster);
        assert_eq!(submap.points().count(), 3);
        assert!((raster[[8 - 4, 8 + 1]] - 0.5).abs() < 1e-6);
        assert!((raster[[8 - 2, 8 - 3]] - 0.5).abs() < 1e-5);
        assert!((raster.sum() - 1.0).abs() < 1e-5);
    }
}
