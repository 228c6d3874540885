//! One street.

use gyre_geometry::Pose;
use nalgebra::Point2;

/// A street, as a line of points that are some metres apart.
#[derive(Clone, Debug, PartialEq)]
pub struct Street {
    /// The middle of the carriageway, world frame, metres: at least two points.
    pub centre: Vec<Point2<f64>>,
    /// From the middle of the carriageway to its kerbs, metres.
    pub half_width_m: f64,
    /// Whether the drive takes it; the others run on from it through the town.
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

    /// A place on the centre line and the street's direction there, x along it.
    pub fn at(&self, along_m: f64) -> Pose {
        let mut left_m = along_m;
        let mut pose = Pose::identity();
        for ends in self.centre.windows(2) {
            let way = ends[1] - ends[0];
            let length_m = way.norm();
            let share = if length_m > 0.0 {
                left_m / length_m
            } else {
                0.0
            };
            pose = Pose::new(ends[0].coords + way * share, way.y.atan2(way.x));
            if share <= 1.0 {
                break;
            }
            left_m -= length_m;
        }
        pose
    }
}
