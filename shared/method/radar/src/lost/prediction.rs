//! The scan before as the sensor would see it now.

use std::f32::consts::TAU;

use gyre_geometry::{Pose, Twist};
use nalgebra::Vector2;

use super::echoes::{Echoes, Layout};
use crate::scan::{PolarScan, Sense};

/// Range at which the time between two looks in one direction is determined, m.
const TYPICAL_M: f32 = 30.0;
/// Azimuths beyond the turn, to either side, that a prediction has.
const BEYOND: usize = 32;

/// The motion of the sensor from one turn to the next: at a constant velocity, so between two looks
/// at the same azimuth by the same motion.
#[derive(Clone, Copy, Debug)]
pub(super) struct Motion {
    /// The pose after a turn, in the sense of the azimuths.
    pose: Pose,
    /// Change of that pose, in the same frame: m/s and rad/s.
    velocity_mps: Vector2<f64>,
    yaw_rate_radps: f64,
    /// From the first azimuth to the last one.
    turn_s: f64,
}

impl Motion {
    pub fn new(before_ns: i64, scan: &PolarScan<'_>, twist: &Twist) -> Self {
        let twist = match scan.geometry.sense {
            Sense::Clockwise => twist.mirrored(),
            Sense::CounterClockwise => *twist,
        };
        let between_ns = scan.geometry.stamp_ns.saturating_sub(before_ns);
        let pose = twist.pose_at(between_ns as f64 * 1e-9);
        Self {
            pose,
            velocity_mps: pose.rotation * Vector2::new(twist.vx_mps, twist.vy_mps),
            yaw_rate_radps: twist.yaw_rate_radps,
            turn_s: scan.time_s(scan.geometry.azimuths - 1) - scan.time_s(0),
        }
    }

    /// Returns the sensor at the time when it sees again what it saw in a direction.
    fn seen_from(&self, bearing_rad: f32) -> Moved {
        let (sin, cos) = bearing_rad.sin_cos();
        let after = |later_s: f64| {
            let at_m = self.pose.translation.vector + self.velocity_mps * later_s;
            Moved {
                x_m: at_m.x as f32,
                y_m: at_m.y as f32,
                yaw_rad: (self.pose.rotation.angle() + self.yaw_rate_radps * later_s) as f32,
                sin,
                cos,
            }
        };
        // Now it sees that earlier in its turn, or later.
        let (turned_rad, _) = after(0.0).sees(TYPICAL_M);
        after(f64::from(turned_rad / TAU) * self.turn_s)
    }
}

/// The sensor in its frame of one turn before, and a direction of then.
struct Moved {
    x_m: f32,
    y_m: f32,
    yaw_rad: f32,
    sin: f32,
    cos: f32,
}

impl Moved {
    /// Returns by how much further along the turn the sensor sees what it saw in that direction at
    /// a range, rad, and its range, m.
    fn sees(&self, range_m: f32) -> (f32, f32) {
        let along = (range_m - self.x_m * self.cos - self.y_m * self.sin).max(0.1);
        let across = self.x_m * self.sin - self.y_m * self.cos;
        let slope = (across / along).clamp(-1.0, 1.0);
        // The arc tangent, to 0.005 rad.
        let turned = slope / (1.0 + 0.28 * slope * slope);
        (turned - self.yaw_rad, along * (1.0 + slope * slope).sqrt())
    }
}

/// The predicted powers.
#[derive(Clone, Debug, Default)]
pub(super) struct Prediction {
    layout: Layout,
    /// Cell x azimuth, those within [`BEYOND`] of the turn's ends on both sides.
    powers: Vec<f32>,
    /// Sum of the squares of an azimuth's powers.
    energies: Vec<f32>,
}

impl Prediction {
    /// Draws the echoes of the scan before where the sensor sees them now.
    pub fn make(&mut self, before: &Echoes, motion: &Motion) {
        self.layout = before.layout;
        let Layout {
            azimuths,
            cells,
            first_m,
            cell_m,
            ..
        } = self.layout;
        let per_rad = azimuths as f32 / TAU;
        self.powers.clear();
        self.powers.resize(self.width() * cells, 0.0);
        let mut from = (f32::NAN, motion.seen_from(0.0));
        for echo in &before.echoes {
            if from.0 != echo.at {
                from = (echo.at, motion.seen_from(echo.at / per_rad));
            }
            let (turned_rad, range_m) = from.1.sees(first_m + f32::from(echo.cell) * cell_m);
            let azimuth = echo.at + turned_rad * per_rad;
            self.draw(azimuth, (range_m - first_m) / cell_m, echo.power);
        }
        self.close();
    }

    /// Distributes a power over the azimuths and cells on both sides.
    fn draw(&mut self, azimuth: f32, cell: f32, power: f32) {
        if cell < 0.0 || cell >= (self.layout.cells - 1) as f32 {
            return;
        }
        let azimuths = self.layout.azimuths as f32;
        let azimuth = match azimuth {
            ..0.0 => azimuth + azimuths,
            _ if azimuth >= azimuths => azimuth - azimuths,
            _ => azimuth,
        };
        let (low, near) = (azimuth as usize, cell as usize);
        let (share, depth) = (azimuth - low as f32, cell - near as f32);
        let width = self.width();
        for (cell, depth) in [(near, 1.0 - depth), (near + 1, depth)] {
            // The azimuth behind the last is one beyond the turn.
            let around = &mut self.powers[cell * width + BEYOND + low..][..2];
            around[0] += power * depth * (1.0 - share);
            around[1] += power * depth * share;
        }
    }

    /// Repeats the turn's ends beyond it, and sums the energies.
    fn close(&mut self) {
        let (width, azimuths) = (self.width(), self.layout.azimuths);
        self.energies.clear();
        self.energies.resize(width, 0.0);
        for powers in self.powers.chunks_exact_mut(width) {
            powers[BEYOND] += powers[BEYOND + azimuths];
            powers.copy_within(BEYOND..2 * BEYOND, BEYOND + azimuths);
            powers.copy_within(azimuths..azimuths + BEYOND, 0);
            for (energy, power) in self.energies.iter_mut().zip(&*powers) {
                *energy += power * power;
            }
        }
    }

    /// Azimuths of the turn and beyond it.
    fn width(&self) -> usize {
        self.layout.azimuths + 2 * BEYOND
    }

    /// Returns the powers of a cell at an azimuth and those behind it.
    pub fn from(&self, cell: usize, azimuth: isize) -> &[f32] {
        let width = self.width();
        &self.powers[cell * width..][..width][(azimuth + BEYOND as isize) as usize..]
    }

    /// Returns the sum of the squares of an azimuth's powers.
    pub fn energy(&self, azimuth: isize) -> f32 {
        self.energies[(azimuth + BEYOND as isize) as usize]
    }
}
