//! One street.

use gyre_geometry::Pose;
use nalgebra::Point2;

/// A street, as a polyline with points some metres apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Street {
    /// The centre line, world frame, metres: at least two points.
    pub centre: Vec<Point2<f64>>,
    /// Distance from the centre line to the kerbs, metres.
    pub half_width_m: f64,
    /// True if the ego vehicle drives on it; false for side streets.
    pub driven: bool,
}

impl Street {
    /// Length of the centre line, metres.
    pub fn length_m(&self) -> f64 {
        self.centre
            .windows(2)
            .map(|ends| (ends[1] - ends[0]).norm())
            .sum()
    }

    /// The pose at a distance along the centre line, x along the street.
    pub fn at(&self, along_m: f64) -> Pose {
        let mut left_m = along_m;
        let mut pose = Pose::identity();
        for ends in self.centre.windows(2) {
            let segment = ends[1] - ends[0];
            let length_m = segment.norm();
            let share = if length_m > 0.0 {
                left_m / length_m
            } else {
                0.0
            };
            pose = Pose::new(ends[0].coords + segment * share, segment.y.atan2(segment.x));
            if share <= 1.0 {
                break;
            }
            left_m -= length_m;
        }
        pose
    }
}
