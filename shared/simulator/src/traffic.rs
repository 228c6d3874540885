//! Other vehicles on the loop: they move, and so must not be mistaken for the town.

use std::f64::consts::PI;
use std::sync::Arc;

use nalgebra::{Isometry2, Point2, Vector2};
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use serde::{Deserialize, Serialize};

use crate::SimulatorError;
use crate::config::within;
use crate::town;
use crate::trajectory::Trajectory;
use crate::world::{Body, Movers, Moving};

/// Seconds between vehicles that drive the same way.
const HEADWAY_S: f64 = 1.9;
/// How far to the right the oncoming lane is, metres (traffic keeps left).
const ONCOMING_LANE_M: f64 = 3.2;
/// Oncoming vehicles' speed as a share of ours, so that they are met elsewhere each lap.
const ONCOMING_PACE: f64 = 0.85;
/// Bodies of vehicles are numbered from here; the town has fewer.
const FIRST_BODY: u32 = 1 << 24;

/// How much moves: the section `[simulation.traffic]`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct TrafficConfig {
    /// Other vehicles on the way, every second one towards us.
    pub vehicles: usize,
}

impl Default for TrafficConfig {
    fn default() -> Self {
        Self { vehicles: 4 }
    }
}

impl TrafficConfig {
    /// Refuses what cannot be simulated, naming the key.
    pub fn validate(&self) -> Result<(), SimulatorError> {
        within("traffic.vehicles", self.vehicles as f64, 0.0, 20.0)
    }
}

/// Vehicles on the way that the sensor takes.
#[derive(Clone)]
pub struct Traffic {
    trajectory: Arc<dyn Trajectory>,
    vehicles: Vec<Body>,
}

impl Traffic {
    /// So many vehicles: the first follows, the second comes towards us, the third drives ahead, and so on.
    pub fn new(config: &TrafficConfig, trajectory: Arc<dyn Trajectory>, seed: u64) -> Self {
        let vehicle = |index: usize| {
            let mut rng = ChaCha8Rng::seed_from_u64(seed ^ (0x7261_6666_6963 + index as u64));
            town::car(FIRST_BODY + index as u32, &mut rng)
        };
        Self { trajectory, vehicles: (0..config.vehicles).map(vehicle).collect() }
    }
}

impl Movers for Traffic {
    fn visit<'a>(&'a self, time_s: f64, centre: Point2<f64>, reach_m: f64, see: &mut dyn FnMut(Moving<'a>)) {
        let half_s = 0.5e-3;
        for (index, body) in self.vehicles.iter().enumerate() {
            let at = |time_s: f64| vehicle_pose(self.trajectory.as_ref(), index, time_s);
            let pose = at(time_s);
            let way = at(time_s + half_s).translation.vector - at(time_s - half_s).translation.vector;
            if (pose.translation.vector - centre.coords).norm() < reach_m {
                see(Moving { body, pose, velocity: way / (2.0 * half_s) });
            }
        }
    }
}

fn vehicle_pose(path: &dyn Trajectory, index: usize, time_s: f64) -> Isometry2<f64> {
    let place = (index / 4 + 1) as f64;
    match index % 4 {
        0 => path.pose(time_s - HEADWAY_S * place),
        2 => path.pose(time_s + HEADWAY_S * place),
        _ => {
            let lane = Isometry2::new(Vector2::new(0.0, -ONCOMING_LANE_M), PI);
            path.pose(10.0 * index as f64 - ONCOMING_PACE * time_s) * lane
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::trajectory::BlockLoop;

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
