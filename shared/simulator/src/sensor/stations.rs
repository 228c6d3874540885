//! Where the sensor is at each azimuth of a sweep, and when its beam passes a place.

use std::f64::consts::TAU;

use nalgebra::{Point2, Vector2};

use super::sweep_time::SweepTime;
use crate::path::Path;
use crate::profile::Sampling;

/// Azimuths before the first and after the last whose poses are known: a beam reaches into a sweep from there.
pub(super) const MARGIN: usize = 16;

/// The sensor at one azimuth.
#[derive(Clone, Copy, Debug)]
pub(super) struct Station {
    pub position: Point2<f64>,
    pub velocity: Vector2<f64>,
    /// Where the beam would stand at azimuth zero, radians: the heading, less the encoder's error here.
    pub heading_rad: f64,
    /// Unit vector along the beam, world frame.
    pub beam: Vector2<f64>,
    /// How far the beam points up, radians.
    pub lift_rad: f64,
    /// Time since the middle of the sweep, seconds; zero at all azimuths where they are all measured then.
    pub time_s: f64,
}

/// The sensor at all azimuths of a sweep and at [`MARGIN`] more to each side.
#[derive(Clone, Debug, Default)]
pub(super) struct Stations {
    all: Vec<Station>,
    azimuths: usize,
    first_rad: f64,
    step_rad: f64,
}

impl Stations {
    /// Follows a sweep. `error_rad` says by how much the beam stands to the right of an azimuth as reported, `lift_rad` by how much
    /// it points up at a time on the trajectory, seconds, and an azimuth.
    pub fn follow(
        &mut self,
        path: &dyn Path,
        time: SweepTime,
        sampling: &Sampling,
        moving: bool,
        error_rad: impl Fn(f64) -> f64,
        lift_rad: impl Fn(f64, f64) -> f64,
    ) {
        let middle_s = time.drive_time_s(time.middle_us());
        self.azimuths = sampling.azimuths;
        self.first_rad = sampling.azimuth_rad(0);
        self.step_rad = sampling.step_rad();
        self.all.clear();
        for index in 0..sampling.azimuths + 2 * MARGIN {
            let azimuth = index as f64 - MARGIN as f64;
            let since_start_s = azimuth * time.period_us as f64 * 1e-6 / sampling.azimuths as f64;
            let time_s = if moving {
                time.drive_time_s(time.start_us) - middle_s + since_start_s
            } else {
                0.0
            };
            let pose = path.pose(middle_s + time_s);
            let velocity = path.velocity(middle_s + time_s);
            let azimuth_rad = self.first_rad + azimuth * self.step_rad;
            // Azimuths grow clockwise, angles counter-clockwise.
            let heading_rad = pose.rotation.angle() - error_rad(azimuth_rad);
            let (sine, cosine) = (heading_rad - azimuth_rad).sin_cos();
            let position = Point2::from(pose.translation.vector);
            let lift_rad = lift_rad(middle_s + time_s, azimuth_rad);
            self.all.push(Station {
                position,
                velocity,
                heading_rad,
                beam: Vector2::new(cosine, sine),
                lift_rad,
                time_s,
            });
        }
    }

    /// The sensor at the azimuth nearest to this one, of `-MARGIN..azimuths + MARGIN`.
    pub fn at(&self, azimuth: f64) -> &Station {
        &self.all[self.index(azimuth)]
    }

    fn index(&self, azimuth: f64) -> usize {
        // What is below zero becomes zero.
        ((azimuth + MARGIN as f64 + 0.5) as usize).min(self.all.len() - 1)
    }

    /// The sensor at the middle of the sweep.
    pub fn middle(&self) -> &Station {
        self.at((self.azimuths / 2) as f64)
    }

    /// Azimuths of the sweep.
    pub fn azimuths(&self) -> usize {
        self.azimuths
    }

    /// Radians from one azimuth to the next.
    pub fn step_rad(&self) -> f64 {
        self.step_rad
    }

    /// Shows when, in azimuths with fractions, the beam passes a thing that is at `place(station)`: once as a rule, twice or
    /// never near the sweep's seam if the vehicle turns; also when it passes up to [`MARGIN`] azimuths before or after.
    pub fn passings(&self, place: impl Fn(&Station) -> Point2<f64>, mut see: impl FnMut(f64)) {
        let turn = self.azimuths as f64;
        let guess = self.bearing(self.middle(), &place).rem_euclid(turn);
        let first = self.passing(guess, &place);
        see(first);
        let margin = 2.0 * MARGIN as f64;
        let other = match first {
            first if first < margin => self.passing(first + turn, &place),
            first if first > turn - margin => self.passing(first - turn, &place),
            _ => return,
        };
        if (other - first).abs() > 0.5 * turn {
            see(other);
        }
    }

    /// Goes to where the beam is expected to pass, looks again from there, and so on.
    fn passing(&self, guess: f64, place: &impl Fn(&Station) -> Point2<f64>) -> f64 {
        let mut azimuth = guess;
        for _ in 0..4 {
            let index = self.index(azimuth);
            let station = &self.all[index];
            let way = place(station) - station.position;
            let next = index as f64 - MARGIN as f64 - angle(station.beam, way) / self.step_rad;
            if (next - azimuth).abs() < 0.05 {
                return next;
            }
            azimuth = next;
        }
        azimuth
    }

    /// Bearing in azimuths, clockwise from the first one, of a thing as seen from a station.
    fn bearing(&self, station: &Station, place: &impl Fn(&Station) -> Point2<f64>) -> f64 {
        let way = place(station) - station.position;
        (station.heading_rad - way.y.atan2(way.x) - self.first_rad).rem_euclid(TAU) / self.step_rad
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
