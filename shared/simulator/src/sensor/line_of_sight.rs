//! Occlusion from the sensor: some rays for each azimuth, with the walls along each.

use nalgebra::{Rotation2, Vector2};

use super::Scene;
use super::sweep_poses::{AzimuthPose, MARGIN, SweepPoses};
use crate::body::{NO_BODY, Wall};
use crate::occlusion::crossing;

/// Rays for each azimuth of 0.9 degrees.
const RAYS: usize = 4;
/// Minimum distance of a wall from the targets behind it that it hides, metres: targets lean
/// against walls.
const CLEARANCE_M: f32 = 0.1;

/// Maximum distance of a moving body's parts from its origin, metres: more than half a car.
const MOVER_M: f64 = 3.0;

#[derive(Clone, Copy, Debug)]
struct WallHit {
    range_m: f32,
    transmission: f32,
    body: u32,
}

/// The rays of a sweep, each from the pose of the sensor at its azimuth.
#[derive(Clone, Debug, Default)]
pub(super) struct LineOfSight {
    /// The walls of each ray, nearest first.
    rays: Vec<Vec<WallHit>>,
}

impl LineOfSight {
    pub fn cast(&mut self, scene: &Scene<'_>, sweep_poses: &SweepPoses, reach_m: f64) {
        let count = (sweep_poses.azimuths + 2 * MARGIN) * RAYS;
        self.rays.resize_with(count, Vec::new);
        for (ray, passed) in self.rays.iter_mut().enumerate() {
            let azimuth = ray as f64 / RAYS as f64 - MARGIN as f64;
            let azimuth_pose = sweep_poses.at(azimuth.floor());
            let turned = azimuth.fract().rem_euclid(1.0) * sweep_poses.step_rad;
            let line = Rotation2::new(-turned) * azimuth_pose.beam * reach_m;
            passed.clear();
            cast_ray(passed, scene, azimuth_pose, line, reach_m);
            passed.sort_unstable_by(|a, b| a.range_m.total_cmp(&b.range_m));
        }
    }

    /// Two-way share of the power that passes to a scatterer of `body` at `range_m` and an azimuth
    /// with fractions.
    pub fn transmission(&self, azimuth: f64, range_m: f64, body: u32) -> f32 {
        let nearer = range_m as f32 - CLEARANCE_M;
        self.ray(azimuth)
            .iter()
            .take_while(|wall| wall.range_m < nearer)
            .filter(|wall| body == NO_BODY || wall.body != body)
            .map(|wall| wall.transmission)
            .product()
    }

    fn ray(&self, azimuth: f64) -> &[WallHit] {
        // The cast turns negative numbers into zero.
        let ray = ((azimuth + MARGIN as f64) * RAYS as f64 + 0.5) as usize;
        &self.rays[ray.min(self.rays.len() - 1)]
    }
}

fn cast_ray(
    passed: &mut Vec<WallHit>,
    scene: &Scene<'_>,
    azimuth_pose: &AzimuthPose,
    line: Vector2<f64>,
    reach_m: f64,
) {
    let mut add = |wall: &Wall, share: f64| {
        passed.push(WallHit {
            range_m: (share * reach_m) as f32,
            transmission: wall.transmission as f32,
            body: wall.body,
        });
    };
    let from = azimuth_pose.position;
    scene.world.walls.between(from, from + line, &mut add);
    for mover in scene.movers {
        let pose = mover.pose_after(azimuth_pose.time_s);
        let from = pose.inverse_transform_point(&azimuth_pose.position);
        let line = pose.inverse_transform_vector(&line);
        // A ray that misses the circle around a body crosses none of its walls.
        let (aside, ahead) = (line.perp(&from.coords).abs(), -line.dot(&from.coords));
        if aside > MOVER_M * reach_m || ahead < -MOVER_M * reach_m {
            continue;
        }
        for wall in &mover.body.walls {
            if let Some(share) = crossing(from, line, wall) {
                add(wall, share);
            }
        }
    }
}
