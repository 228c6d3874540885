//! Other vehicles on the loop: they move, and so must not be mistaken for the town.

use std::f64::consts::PI;

use nalgebra::Isometry2;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;

use crate::path::{BlockLoop, Trajectory};
use crate::town;
use crate::world::{Body, Scatterer, Wall};

/// Seconds between vehicles that drive the same way.
const HEADWAY_S: f64 = 1.9;
/// How far to the right the oncoming lane is, metres (traffic keeps left).
const ONCOMING_LANE_M: f64 = 3.2;
/// Oncoming vehicles' speed as a share of ours, so that they are met elsewhere each lap.
const ONCOMING_PACE: f64 = 0.85;
/// Bodies of vehicles are numbered from here; the town has fewer.
const FIRST_BODY: u32 = 1 << 24;

/// Vehicles that drive round the loop.
#[derive(Clone, Debug, Default)]
pub struct Traffic {
    vehicles: Vec<Body>,
}

impl Traffic {
    /// So many vehicles: the first follows, the second comes towards us, the third drives ahead, and so on.
    pub fn new(count: usize, seed: u64) -> Self {
        let vehicle = |index: usize| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed ^ (0x7261_6666_6963 + index as u64));
            town::car(FIRST_BODY + index as u32, &mut rng)
        };
        Self { vehicles: (0..count).map(vehicle).collect() }
    }

    /// All vehicles' scatterers and walls at one instant, world frame.
    pub fn at(&self, path: &BlockLoop, time_s: f64) -> Body {
        let mut all = Body::default();
        for (index, vehicle) in self.vehicles.iter().enumerate() {
            let pose = vehicle_pose(path, index, time_s);
            all.scatterers.extend(vehicle.scatterers.iter().map(|s: &Scatterer| s.moved(&pose)));
            all.walls.extend(vehicle.walls.iter().map(|w: &Wall| w.moved(&pose)));
        }
        all
    }
}

fn vehicle_pose(path: &BlockLoop, index: usize, time_s: f64) -> Isometry2<f64> {
    let place = (index / 4 + 1) as f64;
    match index % 4 {
        0 => path.pose(time_s - HEADWAY_S * place),
        2 => path.pose(time_s + HEADWAY_S * place),
        _ => {
            let meeting = path.lap_s() * (0.35 + 0.3 * index as f64);
            let lane = Isometry2::new(nalgebra::Vector2::new(0.0, -ONCOMING_LANE_M), PI);
            path.pose(meeting - ONCOMING_PACE * time_s) * lane
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn follower_keeps_its_distance_and_oncoming_traffic_its_lane() {
        let path = BlockLoop::new(48.0, 34.0, 9.5, 5.0);
        for i in 0..400 {
            let time = f64::from(i) * 0.1;
            let own = path.pose(time);
            let follower = own.inverse() * vehicle_pose(&path, 0, time);
            assert!((9.0..20.0).contains(&follower.translation.vector.norm()), "{follower}");
            let oncoming = own.inverse() * vehicle_pose(&path, 1, time);
            assert!(oncoming.translation.vector.norm() > 3.0, "at {time} s: {oncoming}");
        }
    }
}
