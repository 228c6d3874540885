use gyre_geometry::{Pose, Twist};
use nalgebra::{Point2, Vector2};

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacedScan {
    /// Time of the scan, the middle of the sweep, ns.
    pub stamp_ns: i64,
    /// The pose of the sensor at that time, in the frame of the odometry.
    pub pose: Pose,
    /// The velocity of the sensor during the sweep, for deskewing the points: from the motion since
    /// the scan before, by [`Twist::from_chord`].
    pub twist: Twist,
}

#[derive(Clone, Copy, Debug)]
pub(crate) struct Outline {
    pub centre: Point2<f64>,
    pub heading: Vector2<f64>,
    /// Length and width, m.
    pub size_m: [f64; 2],
}

impl Outline {
    /// Returns whether two boxes overlap: whether no line along a side of one of them separates
    /// them (the theorem of separating axes).
    pub fn overlaps(&self, other: &Self) -> bool {
        let apart = other.centre - self.centre;
        let is_between =
            |axis: &Vector2<f64>| apart.dot(axis).abs() > self.reach_m(axis) + other.reach_m(axis);
        let mut axes = self.axes().into_iter().chain(other.axes());
        !axes.any(|axis| is_between(&axis))
    }

    fn axes(&self) -> [Vector2<f64>; 2] {
        [self.heading, Vector2::new(-self.heading.y, self.heading.x)]
    }

    /// Returns how far it reaches from its centre in a direction, a unit vector, m.
    fn reach_m(&self, direction: &Vector2<f64>) -> f64 {
        let sides = self.axes().into_iter().zip(self.size_m);
        sides
            .map(|(side, m)| direction.dot(&side).abs() * m / 2.0)
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_ends_of_a_lorry_are_one_vehicle_and_those_beside_and_behind_it_are_others() {
        let outline = |x: f64, y: f64, yaw_rad: f64, length_m: f64| Outline {
            centre: Point2::new(x, y),
            heading: Vector2::new(yaw_rad.cos(), yaw_rad.sin()),
            size_m: [length_m, 2.0],
        };
        let lorry = outline(10.0, 5.0, 0.0, 9.0);
        assert!(lorry.overlaps(&outline(16.0, 5.5, 0.1, 4.5)));
        assert!(lorry.overlaps(&outline(10.5, 5.0, 3.1, 4.5)));
        assert!(!lorry.overlaps(&outline(17.0, 5.0, 0.0, 4.5)));
        assert!(!lorry.overlaps(&outline(10.0, 7.5, 3.1, 4.5)));
        // One that crosses its way, across it and beside its corner.
        assert!(lorry.overlaps(&outline(6.0, 8.0, 1.57, 4.5)));
        assert!(!lorry.overlaps(&outline(15.6, 7.5, -0.785, 4.5)));
    }
}
