//! The input of the network: where the last scans had returns, around the sensor.

use std::collections::VecDeque;

use gyre_geometry::{Pose, SparsePoint};
use nalgebra::{Isometry2, Point2};

use crate::PlacedScan;

pub(crate) const SIDE: usize = 256;
const CELLS: usize = SIDE * SIDE;
pub(crate) const CELL_M: f64 = 0.5;
/// Planes: one for each of the last scans, the share of those before, and the range.
pub(crate) const PLANES: usize = RECENT + 2;
const RECENT: usize = 6;
/// Scans that are remembered: those without a plane of their own show what stands.
const REMEMBERED: usize = 20;
/// The time between planes, ns: one turn of the radars of the training.
const TURN_NS: i64 = 250_000_000;
const LEAST_WEIGHT: f32 = 1.0 / 255.0;

/// A return of a scan, as if the sensor had stood.
#[derive(Clone, Copy, Debug)]
struct Return {
    /// Position from the sensor at the scan's time, m.
    at: Point2<f32>,
    /// Weight from `LEAST_WEIGHT` to 1.
    weight: f32,
}

struct Seen {
    stamp_ns: i64,
    pose: Pose,
    returns: Vec<Return>,
}

pub(crate) struct Memory {
    scans: VecDeque<Seen>,
    /// The planes that were drawn last, kept since fresh memory costs a page fault for each page.
    planes: Vec<f32>,
}

impl Memory {
    pub fn new() -> Self {
        let range = |cell: usize| {
            let [x, y] = [cell / SIDE, cell % SIDE].map(|at| centre_m(at) as f32);
            x.hypot(y) / 64.0
        };
        let mut planes = vec![0.0; (PLANES - 1) * CELLS];
        planes.extend((0..CELLS).map(range));
        Self {
            scans: VecDeque::new(),
            planes,
        }
    }

    /// Adds a scan: its points, and where they are from the sensor without its motion and Doppler
    /// shift.
    pub fn add(&mut self, scan: &PlacedScan, points: &[SparsePoint], deskewed: &[Point2<f64>]) {
        let returns = points.iter().zip(deskewed);
        let returns = returns.map(|(point, from_sensor)| Return {
            at: from_sensor.cast(),
            weight: point.weight.clamp(LEAST_WEIGHT, 1.0),
        });
        self.scans.push_front(Seen {
            stamp_ns: scan.stamp_ns,
            pose: scan.pose,
            returns: returns.collect(),
        });
        self.scans.truncate(REMEMBERED);
    }

    pub fn clear(&mut self) {
        self.scans.clear();
    }

    /// Draws the scans around the sensor at the pose of the newest one: planes x SIDE x SIDE, x
    /// ahead in rows, y to the left in columns.
    /// A plane of a scan has the largest weight of its returns in each cell; the next one the share
    /// of all scans before these that had a return there, and the last one the range over 64 m.
    pub fn draw(&mut self, pose: &Pose) -> &[f32] {
        let (recent, rest) = self.planes.split_at_mut(RECENT * CELLS);
        let share = &mut rest[..CELLS];
        recent.fill(0.0);
        share.fill(0.0);
        let newest_ns = self.scans.front().map_or(0, |scan| scan.stamp_ns);
        // The last scan that counted in each cell.
        let mut counted = vec![0u8; CELLS];
        let mut before = 0;
        for scan in &self.scans {
            let turns = (newest_ns.saturating_sub(scan.stamp_ns) + TURN_NS / 2) / TURN_NS;
            let plane = usize::try_from(turns).ok().filter(|turns| *turns < RECENT);
            before += u8::from(plane.is_none());
            let there: Isometry2<f32> = pose.inv_mul(&scan.pose).cast();
            for found in &scan.returns {
                let at = there * found.at;
                let Some(cell) = cell(at.x, at.y) else {
                    continue;
                };
                if let Some(plane) = plane {
                    let weight = &mut recent[plane * CELLS + cell];
                    *weight = weight.max(found.weight);
                } else if counted[cell] != before {
                    counted[cell] = before;
                    share[cell] += 1.0;
                }
            }
        }
        let before = f32::from(before.max(1));
        share.iter_mut().for_each(|count| *count /= before);
        &self.planes
    }
}

fn cell(x_m: f32, y_m: f32) -> Option<usize> {
    let at = |metres: f32| {
        let at = metres / CELL_M as f32 + (SIDE / 2) as f32;
        // The whole part equals the floor, since no value is negative.
        (0.0..SIDE as f32).contains(&at).then_some(at as usize)
    };
    Some(at(x_m)? * SIDE + at(y_m)?)
}

fn centre_m(at: usize) -> f64 {
    (at as f64 + 0.5 - (SIDE / 2) as f64) * CELL_M
}

#[cfg(test)]
mod tests {
    use super::*;
    use gyre_geometry::{Twist, pose};
    use std::f64::consts::FRAC_PI_2;

    /// Scans from a vehicle that drives to the left, with a post at one place of the world.
    fn memory(stamps_s: &[f64]) -> (Memory, Pose) {
        let mut memory = Memory::new();
        let mut last = Pose::identity();
        for stamp_s in stamps_s {
            last = pose(10.0, 8.0 * stamp_s, FRAC_PI_2);
            let seen = last.inverse() * Point2::new(9.8, 40.2);
            let scan = PlacedScan {
                stamp_ns: (stamp_s * 1e9) as i64,
                pose: last,
                twist: Twist::default(),
            };
            let point = SparsePoint::from([seen.x as f32, seen.y as f32, 0.0, 0.7, 0.0]);
            memory.add(&scan, &[point], &[seen]);
        }
        (memory, last)
    }

    #[test]
    fn what_stands_is_in_one_cell_of_all_planes_wherever_the_vehicle_was() {
        let stamps_s: Vec<f64> = (0..12).map(|scan| 0.25 * f64::from(scan)).collect();
        let (mut memory, pose) = memory(&stamps_s);
        let planes = memory.draw(&pose);
        // 40.2 - 22 = 18.2 m ahead, and 0.2 m to the left.
        let cell = (36 + SIDE / 2) * SIDE + SIDE / 2;
        for plane in 0..RECENT {
            assert_eq!(planes[plane * CELLS + cell], 0.7, "{plane}");
        }
        assert_eq!(planes[RECENT * CELLS + cell], 1.0);
        let others = &planes[..(RECENT + 1) * CELLS];
        assert_eq!(others.iter().filter(|value| **value > 0.0).count(), 7);
        // Sides of the cell at 18.25 and 0.25 m.
        let range = planes[(PLANES - 1) * CELLS + cell];
        assert!((range - 18.25f32.hypot(0.25) / 64.0).abs() < 1e-6);
    }

    #[test]
    fn what_was_drawn_before_is_gone() {
        let stamps_s: Vec<f64> = (0..12).map(|scan| 0.25 * f64::from(scan)).collect();
        let (mut memory, pose) = memory(&stamps_s);
        let range = memory.draw(&pose)[(PLANES - 1) * CELLS..].to_vec();
        memory.clear();
        let (drawn, same) = memory.draw(&pose).split_at((PLANES - 1) * CELLS);
        assert!(drawn.iter().all(|value| *value == 0.0) && same == range);
    }

    #[test]
    fn a_scan_that_was_lost_leaves_its_plane_empty() {
        let (mut memory, pose) = memory(&[0.0, 0.25, 0.75, 1.0]);
        let planes = memory.draw(&pose);
        let is_drawn = |plane: usize| {
            let plane = &planes[plane * CELLS..(plane + 1) * CELLS];
            plane.iter().any(|value| *value > 0.0)
        };
        let drawn: Vec<bool> = (0..=RECENT).map(is_drawn).collect();
        assert_eq!(drawn, [true, true, false, true, true, false, false]);
    }
}
