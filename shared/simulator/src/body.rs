//! Bodies: scatterers that reflect and walls that hide the space behind them, standing or moving.

use gyre_geometry::Pose;
use nalgebra::{Point2, Vector2};

/// The body number of scatterers and walls that belong to no body.
pub const NO_BODY: u32 = 0;

/// The dependence of a scatterer's reflection on direction.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Aspect {
    /// The same in all directions: posts, leaves, corners of cars.
    AllRound,
    /// Mainly in one direction: power falls with the cosine of the angle from `normal`, raised to
    /// `sharpness` (1 to 2: rough walls; 300: a smooth panel that flashes within some degrees).
    Facing {
        /// Unit vector, world frame.
        normal: Vector2<f64>,
        /// Exponent of the cosine.
        sharpness: f64,
    },
}

impl Aspect {
    /// Share of the power that is reflected towards `direction`, a unit vector from the scatterer
    /// to the sensor: 0 to 1.
    pub fn gain(&self, direction: Vector2<f64>) -> f64 {
        match *self {
            Self::AllRound => 1.0,
            Self::Facing { normal, sharpness } => normal.dot(&direction).max(0.0).powf(sharpness),
        }
    }
}

#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scatterer {
    /// Position, world frame, metres.
    pub position: Point2<f64>,
    pub cross_section_m2: f64,
    /// The dependence on direction.
    pub aspect: Aspect,
    /// The body, whose walls do not hide it; [`NO_BODY`] if it has none.
    pub body: u32,
}

/// A straight wall that lets a part of the power pass.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Wall {
    /// One end, world frame, metres.
    pub from: Point2<f64>,
    /// The other end.
    pub to: Point2<f64>,
    /// Two-way share of the power that passes: 0 to 1.
    pub transmission: f64,
    pub body: u32,
}

impl Scatterer {
    /// A scatterer that reflects in all directions.
    pub fn all_round(position: Point2<f64>, cross_section_m2: f64, body: u32) -> Self {
        Self {
            position,
            cross_section_m2,
            aspect: Aspect::AllRound,
            body,
        }
    }

    /// The same scatterer on a body that stands at `pose`.
    pub fn moved(&self, pose: &Pose) -> Self {
        let aspect = match self.aspect {
            Aspect::AllRound => Aspect::AllRound,
            Aspect::Facing { normal, sharpness } => Aspect::Facing {
                normal: pose * normal,
                sharpness,
            },
        };
        Self {
            position: pose * self.position,
            aspect,
            ..*self
        }
    }
}

impl Wall {
    /// The same wall on a body that stands at `pose`.
    pub fn moved(&self, pose: &Pose) -> Self {
        Self {
            from: pose * self.from,
            to: pose * self.to,
            ..*self
        }
    }
}

/// Scatterers and walls.
#[derive(Clone, Debug, Default)]
pub struct Body {
    pub scatterers: Vec<Scatterer>,
    pub walls: Vec<Wall>,
}

/// A moving body at an instant.
#[derive(Clone, Copy, Debug)]
pub struct Moving<'a> {
    /// The content, in its own frame (x ahead), with a number that no other body has.
    pub body: &'a Body,
    /// The pose of its frame in the world.
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
