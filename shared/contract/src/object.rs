//! `objects`: the moving objects of a scan.

use crate::{
    item::Item,
    limits::Limits,
    message::Header,
    motion::place,
    wire::{Bounds, REACH, field, require, wire},
};

/// Objects that a message lists, at most: those nearest to the vehicle. The others are counted, and
/// in `journal/objects.log`.
pub const MAX_LISTED: usize = 64;
const SIZE: Bounds = Bounds::Within(0.0, 1e3);

wire! {
    /// The objects, in the odometry frame: the frame of the first scan.
    pub struct ObjectsHeader = "gyre_objects_header_v3" {
        /// The item of the scan's pose.
        pub item: Item,
        /// Pose of the sensor at the scan's time: x forward, y to the left, yaw counter-clockwise,
        /// in (-pi, pi].
        pub x_m: f64 [REACH],
        pub y_m: f64 [REACH],
        pub yaw_rad: f64 [Bounds::HalfTurn],
        /// Objects that move, or did and stand now.
        pub objects: u64,
        pub moving: u64,
        pub listed: u64,
        /// The objects nearest to the vehicle, the nearest first; zero beyond `listed`.
        pub list: [Object; MAX_LISTED] [Bounds::CountedBy("listed")],
    }

    /// A moving object at the time of a scan, in the odometry frame: as the tracker, the log, the
    /// results and viewers have it.
    pub struct Object = "gyre_listed_object_v1" {
        /// The identity: counted from 1, and given to no other object of the run.
        pub id: u64,
        /// The centre, and the heading in (-pi, pi]: the direction of the velocity, or the
        /// network's heading for a slow object.
        pub x_m: f64 [REACH],
        pub y_m: f64 [REACH],
        pub yaw_rad: f64 [Bounds::HalfTurn],
        /// The velocity over ground.
        pub vx_mps: f64 [Bounds::Finite],
        pub vy_mps: f64 [Bounds::Finite],
        /// Along the heading, and across it.
        pub length_m: f64 [SIZE],
        pub width_m: f64 [SIZE],
        /// Covariance of the centre: xx, xy and yy, m².
        pub position_covariance: [f64; 3] [Bounds::Finite],
        /// Covariance of the velocity: xx, xy and yy, (m/s)².
        pub velocity_covariance: [f64; 3] [Bounds::Finite],
        /// 1 if it moves, 0 if its speed is not significantly above a standing object's.
        pub moving: u32,
        /// Scans since it was first seen, that one included.
        pub age: u32,
    }
}

impl Header for ObjectsHeader {
    fn check_content(&self, _: &[u8], _: &Limits) -> Result<(), String> {
        let fits = self.moving <= self.objects;
        field("moving", require(fits, self.moving, "at most objects"))?;
        let fits = self.listed == self.objects.min(MAX_LISTED as u64);
        let expected = format_args!("objects, at most {MAX_LISTED}");
        field("listed", require(fits, self.listed, expected))
    }

    fn words(&self, _: &[u8]) -> String {
        let mut text = format!("{} objects, {} move", self.objects, self.moving);
        for object in self.list().iter().filter(|object| object.is_moving()) {
            let place = place(object.x_m, object.y_m, object.yaw_rad);
            let (id, speed_mps) = (object.id, object.speed_mps());
            text += &format!("; {id}: {place}, {speed_mps:.1} m/s");
        }
        text
    }
}

impl ObjectsHeader {
    pub fn list(&self) -> &[Object] {
        &self.list[..(self.listed as usize).min(MAX_LISTED)]
    }
}

impl Object {
    pub fn is_moving(&self) -> bool {
        self.moving != 0
    }

    pub fn speed_mps(&self) -> f64 {
        self.vx_mps.hypot(self.vy_mps)
    }

    pub fn drawing(&self) -> Drawing {
        Drawing {
            sides_m: [self.length_m, self.width_m, Drawing::HEIGHT_M],
            // Orange or grey.
            colour: match self.is_moving() {
                true => [1.0, 0.55, 0.1],
                false => [0.6, 0.65, 0.7],
            },
            label: self.id.to_string(),
            arrow_m: self.is_moving().then(|| self.speed_mps()),
        }
    }
}

/// The parts of an object in a viewer: a box, its identity above, and an arrow along its velocity.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawing {
    /// Length, width and height of the box, m.
    pub sides_m: [f64; 3],
    /// Red, green and blue, from 0 to 1, by whether it moves.
    pub colour: [f64; 3],
    pub label: String,
    /// The displacement in a second, m, if it moves.
    pub arrow_m: Option<f64>,
}

impl Drawing {
    /// The height of boxes, m: a radar in the plane does not measure it.
    pub const HEIGHT_M: f64 = 1.6;
    /// The opacity of boxes, from 0 to 1. Arrows and letters are opaque.
    pub const OPACITY: f64 = 0.5;
    /// The diameter of an arrow's head, m.
    pub const ARROW_M: f64 = 0.9;
    /// The height of a letter, m.
    pub const LETTER_M: f64 = 1.2;
}
