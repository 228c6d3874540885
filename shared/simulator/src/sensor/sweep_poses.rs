//! The sensor's pose at each azimuth of a sweep, and the times when its beam passes a place.

use std::f64::consts::TAU;

use nalgebra::{Point2, Vector2};

use crate::path::Path;
use crate::profile::Sampling;

/// Additional azimuths before the first and after the last, whose beams reach into the sweep.
pub(super) const MARGIN: usize = 16;

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SweepTime {
    pub start_us: i64,
    pub period_us: i64,
    pub azimuths: usize,
    /// The start of the drive, microseconds since 1970.
    pub epoch_us: i64,
}

impl SweepTime {
    pub fn stamp_us(&self, azimuth: usize) -> i64 {
        self.start_us + self.period_us * azimuth as i64 / self.azimuths as i64
    }

    /// Middle of the sweep: half-way between the first and the last azimuth, microseconds since
    /// 1970.
    pub fn middle_us(&self) -> i64 {
        self.start_us + (self.stamp_us(self.azimuths - 1) - self.start_us) / 2
    }

    /// Time of a stamp since the start of the drive, seconds.
    pub fn drive_time_s(&self, stamp_us: i64) -> f64 {
        (stamp_us - self.epoch_us) as f64 * 1e-6
    }
}

#[derive(Clone, Copy, Debug)]
pub(super) struct AzimuthPose {
    pub position: Point2<f64>,
    pub velocity: Vector2<f64>,
    /// Direction of azimuth zero, radians: the heading less the encoder's error.
    pub heading_rad: f64,
    pub beam: Vector2<f64>,
    pub time_s: f64,
}

/// The sensor at all azimuths of a sweep and at [`MARGIN`] more on each side.
#[derive(Clone, Debug, Default)]
pub(super) struct SweepPoses {
    all: Vec<AzimuthPose>,
    pub azimuths: usize,
    first_rad: f64,
    pub step_rad: f64,
}

impl SweepPoses {
    /// Samples the path during a sweep. `error_rad` is the deviation of the beam to the right of a
    /// reported azimuth.
    pub fn sample(
        &mut self,
        path: &dyn Path,
        time: SweepTime,
        sampling: &Sampling,
        error_rad: impl Fn(f64) -> f64,
    ) {
        let middle_s = time.drive_time_s(time.middle_us());
        self.azimuths = sampling.azimuths;
        self.first_rad = sampling.azimuth_rad(0);
        self.step_rad = sampling.step_rad();
        self.all.clear();
        for index in 0..sampling.azimuths + 2 * MARGIN {
            let azimuth = index as f64 - MARGIN as f64;
            let since_start_s = azimuth * time.period_us as f64 * 1e-6 / sampling.azimuths as f64;
            let time_s = time.drive_time_s(time.start_us) - middle_s + since_start_s;
            let pose = path.pose(middle_s + time_s);
            let velocity = path.velocity(middle_s + time_s);
            let azimuth_rad = self.first_rad + azimuth * self.step_rad;
            // Azimuths increase clockwise, angles counter-clockwise.
            let heading_rad = pose.rotation.angle() - error_rad(azimuth_rad);
            let (sine, cosine) = (heading_rad - azimuth_rad).sin_cos();
            let position = Point2::from(pose.translation.vector);
            self.all.push(AzimuthPose {
                position,
                velocity,
                heading_rad,
                beam: Vector2::new(cosine, sine),
                time_s,
            });
        }
    }

    /// The sensor at the nearest azimuth of `-MARGIN..azimuths + MARGIN`.
    pub fn at(&self, azimuth: f64) -> &AzimuthPose {
        &self.all[self.index(azimuth)]
    }

    fn index(&self, azimuth: f64) -> usize {
        // The cast turns negative numbers into zero.
        ((azimuth + MARGIN as f64 + 0.5) as usize).min(self.all.len() - 1)
    }

    pub fn middle(&self) -> &AzimuthPose {
        self.at((self.azimuths / 2) as f64)
    }

    /// Visits the azimuths, with fractions, where the beam passes an object at
    /// `place(azimuth_pose)`: usually once, twice or never near the sweep's seam if the vehicle
    /// turns, and up to [`MARGIN`] azimuths outside the sweep.
    pub fn beam_passes(
        &self,
        place: impl Fn(&AzimuthPose) -> Point2<f64>,
        mut visit: impl FnMut(f64),
    ) {
        let turn = self.azimuths as f64;
        let guess = self.bearing(self.middle(), &place).rem_euclid(turn);
        let first = self.beam_pass(guess, &place);
        visit(first);
        let margin = 2.0 * MARGIN as f64;
        let other = match first {
            first if first < margin => self.beam_pass(first + turn, &place),
            first if first > turn - margin => self.beam_pass(first - turn, &place),
            _ => return,
        };
        if (other - first).abs() > 0.5 * turn {
            visit(other);
        }
    }

    fn beam_pass(&self, guess: f64, place: &impl Fn(&AzimuthPose) -> Point2<f64>) -> f64 {
        let mut azimuth = guess;
        for _ in 0..4 {
            let index = self.index(azimuth);
            let azimuth_pose = &self.all[index];
            let ray = place(azimuth_pose) - azimuth_pose.position;
            let next = index as f64 - MARGIN as f64 - angle(azimuth_pose.beam, ray) / self.step_rad;
            if (next - azimuth).abs() < 0.05 {
                return next;
            }
            azimuth = next;
        }
        azimuth
    }

    /// Bearing of an object in azimuths, clockwise from the first one.
    fn bearing(
        &self,
        azimuth_pose: &AzimuthPose,
        place: &impl Fn(&AzimuthPose) -> Point2<f64>,
    ) -> f64 {
        let ray = place(azimuth_pose) - azimuth_pose.position;
        (azimuth_pose.heading_rad - ray.y.atan2(ray.x) - self.first_rad).rem_euclid(TAU)
            / self.step_rad
    }
}

/// Angle from one direction to another, radians counter-clockwise.
fn angle(from: Vector2<f64>, to: Vector2<f64>) -> f64 {
    let (across, along) = (from.perp(&to), from.dot(&to));
    // The tangent of a small angle is the angle, and much faster.
    if across.abs() < 0.1 * along {
        across / along
    } else {
        across.atan2(along)
    }
}
