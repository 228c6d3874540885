//! The plane of motion of poses in space: x-y of a vehicle, x-z of a camera.

/// A row-major 3 x 4 pose of the sensor in the world. Its rotation may have any scale.
pub(super) type Matrix = [f64; 12];

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Vertical {
    /// x forward, y left or right.
    Z,
    /// A camera: x right, y down, z forward.
    Y,
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Plane {
    world: Vertical,
    sensor: Vertical,
}

/// The longest steps over which the direction of driving is measured, m: above the noise of
/// positions, and short against bends.
const MAX_STEP_M: f64 = 5.0;
/// Steps have at least this share of the extent of a short path.
const STEP_SHARE: f64 = 0.05;
/// Positions within this extent are in one place, m.
const STANDING_M: f64 = 0.1;
/// The least mean cosine between the vertical axes of sensor and world.
const MIN_UPRIGHT: f64 = 0.7;
const UNKNOWN: &str = "the poses are in no known frame: the sensor does not stay upright with x forward and z up (or down), nor as a camera with \
     z forward and y down";
/// No road climbs by more than this share of its length.
const MAX_CLIMB: f64 = 0.3;

impl Plane {
    /// Returns the sensor's plane of motion: a sensor that moves ahead along its z axis is a
    /// camera. Without headings the vertical axis is the one along which it moves least.
    pub fn of(poses: &[Matrix]) -> Result<Self, String> {
        let moved = Displacement::of(poses);
        let vertical = |is_y: bool| if is_y { Vertical::Y } else { Vertical::Z };
        if poses.windows(2).all(|w| rotation(&w[0]) == rotation(&w[1])) {
            let [x, y, z] = moved.in_world;
            let world = vertical(z > MAX_CLIMB * (x + y + z) && y < 0.5 * z);
            let sensor = world;
            return Ok(Self { world, sensor });
        }
        let [x, y, z] = moved.in_sensor;
        let is_camera = match x + y + z > 0.0 {
            true => z > x && z > y,
            false => upright(poses, 1, Vertical::Y) > upright(poses, 2, Vertical::Z),
        };
        let sensor = vertical(is_camera);
        let upright = |axis| upright(poses, axis, sensor);
        let world = vertical(upright(1) > upright(2));
        match upright(1).max(upright(2)) > MIN_UPRIGHT {
            true => Ok(Self { world, sensor }),
            false => Err(UNKNOWN.to_owned()),
        }
    }

    /// Returns x and y in the plane, and the direction ahead as cosine and sine, times the scale of
    /// the rotation.
    pub fn project(self, m: &Matrix) -> [f64; 4] {
        let ahead = match self.sensor {
            Vertical::Z => 0,
            Vertical::Y => 2,
        };
        match self.world {
            Vertical::Z => [m[3], m[7], m[ahead], m[4 + ahead]],
            Vertical::Y => [m[11], -m[3], m[8 + ahead], -m[ahead]],
        }
    }
}

/// The distances moved along each axis, m.
#[derive(Default)]
struct Displacement {
    in_world: [f64; 3],
    in_sensor: [f64; 3],
}

impl Displacement {
    fn of(poses: &[Matrix]) -> Self {
        let mut moved = Self::default();
        let Some(mut last) = poses.first() else {
            return moved;
        };
        let extent_m = poses.iter().map(|p| length(step(last, p)));
        let extent_m = extent_m.fold(0.0, f64::max);
        let step_m = MAX_STEP_M.min(STEP_SHARE * extent_m);
        if extent_m < STANDING_M {
            return moved;
        }
        for pose in poses {
            let step = step(last, pose);
            if length(step) < step_m {
                continue;
            }
            for axis in 0..3 {
                let column = [last[axis], last[4 + axis], last[8 + axis]];
                moved.in_world[axis] += step[axis].abs();
                moved.in_sensor[axis] += dot(column, step).abs();
            }
            last = pose;
        }
        moved
    }
}

fn upright(poses: &[Matrix], axis: usize, sensor: Vertical) -> f64 {
    let column = match sensor {
        Vertical::Z => 2,
        Vertical::Y => 1,
    };
    let cosine = |m: &Matrix| {
        let scale = length([m[column], m[4 + column], m[8 + column]]);
        (m[4 * axis + column] / scale.max(f64::MIN_POSITIVE)).abs()
    };
    poses.iter().map(cosine).sum::<f64>() / poses.len() as f64
}

fn rotation(m: &Matrix) -> [f64; 9] {
    std::array::from_fn(|k| m[4 * (k / 3) + k % 3])
}

fn step(from: &Matrix, to: &Matrix) -> [f64; 3] {
    [to[3] - from[3], to[7] - from[7], to[11] - from[11]]
}

fn dot(a: [f64; 3], b: [f64; 3]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn length(v: [f64; 3]) -> f64 {
    dot(v, v).sqrt()
}
