//! Poses in space, in the plane x-y of the world.

use super::LineError;

/// A row-major 3 x 4 pose of the sensor in the world. Its rotation may have any scale.
pub(super) type Matrix = [f64; 12];

/// The least mean cosine between the vertical axes of sensor and world.
const MIN_UPRIGHT: f64 = 0.7;
/// No road climbs by more than this share of its length.
const MAX_CLIMB: f64 = 0.3;
/// Altitudes vary by so much where a vehicle stands, m.
const ALTITUDE_NOISE_M: f64 = 10.0;
const UNKNOWN: &str = "the poses are in no known frame: the sensor does not stay upright with x forward and z up (or down); turn the poses of a camera \
     so that z is up";

/// Returns x and y of each pose, and its direction ahead as cosine and sine, times the scale of the
/// rotation.
pub(super) fn project(poses: &[Matrix]) -> Result<Vec<[f64; 4]>, LineError> {
    let cosine = |m: &Matrix| m[10].abs() / m[2].hypot(m[6]).hypot(m[10]).max(f64::MIN_POSITIVE);
    let upright = poses.iter().map(cosine).sum::<f64>() / poses.len() as f64;
    match upright > MIN_UPRIGHT && !moves_along_z(poses) {
        true => Ok(poses.iter().map(|m| [m[3], m[7], m[0], m[4]]).collect()),
        false => Err(LineError::new(1, UNKNOWN)),
    }
}

/// Returns whether poses are in the axes of a camera (z forward, y down): on a straight road a
/// camera stays upright about z too.
fn moves_along_z(poses: &[Matrix]) -> bool {
    let [x, y, z] = [3, 7, 11].map(|axis| {
        let at = || poses.iter().map(|m| m[axis]);
        at().fold(f64::MIN, f64::max) - at().fold(f64::MAX, f64::min)
    });
    z > ALTITUDE_NOISE_M && z > MAX_CLIMB * (x + y + z) && y < 0.5 * z
}
