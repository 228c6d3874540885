use gyre_geometry::Pose;
use nalgebra::{Point2, Vector2};

pub const NO_BODY: u32 = 0;

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatterer {
    pub position: Point2<f64>,
    pub cross_section_m2: f64,
    /// Direction of the largest reflection, a unit vector, world frame.
    pub normal: Vector2<f64>,
    /// The power falls with the cosine of the angle from `normal`, raised to this: 1 to 2 for rough
    /// walls, 300 for a smooth panel that flashes within some degrees, 0 for what reflects the same
    /// in all directions.
    pub sharpness: f64,
    /// The body, whose walls do not hide it; [`NO_BODY`] if it has none.
    pub body: u32,
}

/// A straight wall that lets a part of the power pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// One end, world frame, metres.
    pub from: Point2<f64>,
    pub to: Point2<f64>,
    /// Two-way share of the power that passes: 0 to 1.
    pub transmission: f64,
    pub body: u32,
}

impl Scatterer {
    /// A scatterer that reflects the same in all directions: posts, leaves, corners of cars.
    pub fn all_round(position: Point2<f64>, cross_section_m2: f64, body: u32) -> Self {
        Self::facing(position, cross_section_m2, Vector2::x(), 0.0, body)
    }

    /// A scatterer that reflects mainly in one direction.
    pub fn facing(
        position: Point2<f64>,
        cross_section_m2: f64,
        normal: Vector2<f64>,
        sharpness: f64,
        body: u32,
    ) -> Self {
        Self {
            position,
            cross_section_m2,
            normal,
            sharpness,
            body,
        }
    }

    /// Share of the power that is reflected towards `direction`, a unit vector from the scatterer
    /// to the sensor: 0 to 1.
    pub fn gain(&self, direction: Vector2<f64>) -> f64 {
        self.normal.dot(&direction).max(0.0).powf(self.sharpness)
    }

    pub fn moved(&self, pose: &Pose) -> Self {
        Self {
            position: pose * self.position,
            normal: pose * self.normal,
            ..*self
        }
    }
}

impl Wall {
    pub fn new(from: Point2<f64>, to: Point2<f64>, transmission: f64, body: u32) -> Self {
        Self {
            from,
            to,
            transmission,
            body,
        }
    }

    pub fn moved(&self, pose: &Pose) -> Self {
        Self::new(
            pose * self.from,
            pose * self.to,
            self.transmission,
            self.body,
        )
    }
}

#[derive(Clone, Debug, Default)]
pub struct Body {
    pub scatterers: Vec<Scatterer>,
    pub walls: Vec<Wall>,
}

#[derive(Clone, Copy, Debug)]
pub struct Moving<'a> {
    /// The content, in its own frame (x ahead), with a number that no other body has.
    pub body: &'a Body,
    pub pose: Pose,
    /// The velocity of its frame in the world, metres a second.
    pub velocity: Vector2<f64>,
}

impl Moving<'_> {
    /// The pose `time_s` seconds later. Rotation is neglected, since a sweep is short.
    pub fn pose_after(&self, time_s: f64) -> Pose {
        Pose::from_parts(
            (self.pose.translation.vector + self.velocity * time_s).into(),
            self.pose.rotation,
        )
    }
}
