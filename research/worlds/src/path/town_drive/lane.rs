//! The lane along a route: beside the centre lines of its streets, with bends at junctions.

use nalgebra::{Point2, Vector2};

use super::plan::Plan;
use crate::lanes::{DrivingSide, LANE_M};

/// Distance from a junction's centre at which bends begin, metres along the street.
const BEND_M: f64 = 11.0;
/// Distance from a junction's centre at which vehicles wait, metres.
const WAIT_M: f64 = 13.0;
/// Distance between points of the lane, metres.
const STEP_M: f64 = 1.0;

/// A lane through a town.
pub struct Lane {
    pub places: Vec<Point2<f64>>,
    /// The speed limit of each place's street, as a share of the highest.
    pub limits: Vec<f64>,
    /// Indices of the places before junctions where the vehicle may have to wait.
    pub waits: Vec<usize>,
}

/// Builds the lane along a route.
pub fn lane(plan: &Plan, route: &[usize], driving_side: DrivingSide) -> Lane {
    let mut lane = Lane {
        places: Vec::new(),
        limits: Vec::new(),
        waits: Vec::new(),
    };
    for leg in route.windows(3) {
        let along = lane.street(plan, [leg[0], leg[1]], driving_side);
        let (to, onward) = beside(plan, [leg[1], leg[2]], BEND_M, driving_side);
        lane.bend(along, (to, onward), plan.limit(leg[0], leg[1]));
    }
    lane
}

/// The lane's place and direction at a distance along a street.
fn beside(
    plan: &Plan,
    [from, to]: [usize; 2],
    along_m: f64,
    driving_side: DrivingSide,
) -> (Point2<f64>, Vector2<f64>) {
    let (middle, direction) = plan.street(from, to, along_m / plan.distance_m(from, to));
    let left_m = match driving_side {
        DrivingSide::Left => LANE_M / 2.0,
        DrivingSide::Right => -LANE_M / 2.0,
    };
    (
        middle + Vector2::new(-direction.y, direction.x) * left_m,
        direction,
    )
}

impl Lane {
    /// Adds a street up to the bend at its end; returns place and direction there.
    fn street(
        &mut self,
        plan: &Plan,
        ends: [usize; 2],
        driving_side: DrivingSide,
    ) -> (Point2<f64>, Vector2<f64>) {
        let whole_m = plan.distance_m(ends[0], ends[1]);
        let steps = ((whole_m - 2.0 * BEND_M) / STEP_M) as usize;
        let step_m = (whole_m - 2.0 * BEND_M) / steps as f64;
        for step in 0..steps {
            let along_m = BEND_M + step_m * step as f64;
            if along_m < whole_m - WAIT_M && along_m + step_m >= whole_m - WAIT_M {
                self.waits.push(self.places.len());
            }
            self.push(
                beside(plan, ends, along_m, driving_side).0,
                plan.limit(ends[0], ends[1]),
            );
        }
        beside(plan, ends, whole_m - BEND_M, driving_side)
    }

    /// Adds a curve from one place and direction to another (a cubic Bézier curve).
    fn bend(
        &mut self,
        from: (Point2<f64>, Vector2<f64>),
        to: (Point2<f64>, Vector2<f64>),
        limit: f64,
    ) {
        let chord_m = (to.0 - from.0).norm();
        let turn = from.1.angle(&to.1);
        // The handles of a circular arc are 4/3 tan(turn/4) radii long, its chord 2 sin(turn/2)
        // radii.
        let handle_m = if turn < 0.05 {
            chord_m / 3.0
        } else {
            chord_m * (turn / 4.0).tan() / (1.5 * (turn / 2.0).sin())
        };
        let ends = [
            from.0,
            from.0 + from.1 * handle_m,
            to.0 - to.1 * handle_m,
            to.0,
        ]
        .map(|p| p.coords);
        let steps = (chord_m * 1.1 / STEP_M).ceil() as usize;
        for step in 0..steps {
            let (t, u) = (step as f64 / steps as f64, 1.0 - step as f64 / steps as f64);
            let place = ends[0] * u.powi(3)
                + ends[1] * (3.0 * u * u * t)
                + ends[2] * (3.0 * u * t * t)
                + ends[3] * t.powi(3);
            self.push(Point2::from(place), limit);
        }
    }

    fn push(&mut self, place: Point2<f64>, limit: f64) {
        self.places.push(place);
        self.limits.push(limit);
    }
}
