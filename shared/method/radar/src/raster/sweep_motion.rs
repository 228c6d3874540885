use gyre_geometry::{
    Twist,
    scan::{PolarScan, Sense},
};

use super::RasterError;

/// Maximum turn of the sensor between the scan's stamp and any azimuth, rad.
pub const MAX_TURN_RAD: f64 = 2.0;

/// Maximum travel in that time, m.
pub const MAX_TRAVEL_M: f64 = 1e4;

/// Motion of the sensor within a sweep, in the frame of [`super::cells::Cells`].
#[derive(Clone, Copy, Debug)]
pub(super) struct SweepMotion {
    vx_mps: f32,
    vz_mps: f32,
    half_yaw_rate_radps: f32,
    /// Maximum distance of the sensor from its position at the scan's stamp, m.
    pub travel_m: f32,
}

impl SweepMotion {
    pub fn new(twist: Twist, scan: &PolarScan<'_>) -> Result<Self, RasterError> {
        let longest_s = (0..scan.geometry.azimuths)
            .map(|azimuth| scan.time_s(azimuth).abs())
            .fold(0.0, f64::max);
        let turn_rad = (twist.yaw_rate_radps * longest_s).abs();
        let travel_m = twist.speed_mps() * longest_s;
        // Where all rows have the same time any velocity moves nothing, but it must be a number in
        // f32.
        let velocity = [twist.vx_mps, twist.vy_mps, twist.yaw_rate_radps];
        let is_finite = velocity.iter().all(|v| (*v as f32).is_finite());
        if !(is_finite && turn_rad <= MAX_TURN_RAD && travel_m <= MAX_TRAVEL_M) {
            return Err(RasterError::Twist {
                twist,
                turn_rad,
                travel_m,
            });
        }
        let mirrored = match scan.geometry.sense {
            Sense::Clockwise => twist.mirrored(),
            Sense::CounterClockwise => twist,
        };
        Ok(Self {
            vx_mps: mirrored.vx_mps as f32,
            vz_mps: mirrored.vy_mps as f32,
            half_yaw_rate_radps: (0.5 * mirrored.yaw_rate_radps) as f32,
            travel_m: travel_m as f32,
        })
    }

    /// Closing speed to a stationary target at an azimuth, m/s.
    pub fn approach_mps(&self, azimuth_rad: f32) -> f32 {
        let (sin, cos) = azimuth_rad.sin_cos();
        self.vx_mps * cos + self.vz_mps * sin
    }

    pub fn speed_mps(&self) -> f32 {
        self.vx_mps.hypot(self.vz_mps)
    }

    /// Transforms a point from the frame at the scan's stamp to the sensor's frame `t_s` seconds
    /// later: exp(twist t)^-1 p.
    ///
    /// With R the rotation by half of the yaw, the pose at t is (R d, R R), where d is the chord of
    /// the arc before that rotation; its inverse maps p to R' (R' p - d).
    #[inline(always)]
    pub fn in_sensor(&self, x: f32, z: f32, t_s: f32) -> (f32, f32) {
        let half = self.half_yaw_rate_radps * t_s;
        let (sinc, cos) = sinc_cos(half);
        let (sin, chord_s) = (half * sinc, t_s * sinc);
        let (x, z) = (cos * x + sin * z, cos * z - sin * x);
        let (x, z) = (x - self.vx_mps * chord_s, z - self.vz_mps * chord_s);
        (cos * x + sin * z, cos * z - sin * x)
    }
}

/// (sin x / x, cos x) by the first terms of their series, accurate to 1e-6 for |x| <= MAX_TURN_RAD
/// / 2.
#[inline(always)]
fn sinc_cos(x: f32) -> (f32, f32) {
    let s = x * x;
    let sinc = 1.0 + s * (-1.0 / 6.0 + s * (1.0 / 120.0 + s * (-1.0 / 5040.0 + s / 362_880.0)));
    let cos = 1.0 + s * (-0.5 + s * (1.0 / 24.0 + s * (-1.0 / 720.0 + s * (1.0 / 40_320.0))));
    (sinc, cos)
}
