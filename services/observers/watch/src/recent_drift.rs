//! The drift of the last stretch of the path: the uncertainty of the newest pose relative to the
//! pose at the start of the stretch.

use std::collections::VecDeque;

use gyre_contract::{PoseHeader, flag};
use gyre_geometry::{ComposedMotion, OdometryMotion};
use serde::Serialize;

const STRETCH_M: f64 = 100.0;
/// Motions that are kept at most: a vehicle that stands or creeps fills the stretch with them.
const MAX_MOTIONS: usize = 2048;

#[derive(Debug, Default)]
pub struct RecentDrift {
    motions: VecDeque<OdometryMotion>,
    length_m: f64,
}

/// Standard deviations of the newest pose against the one a stretch before.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Drift {
    /// Length of the stretch, m.
    pub over_m: f64,
    pub position_m: f64,
    pub yaw_rad: f64,
}

impl RecentDrift {
    pub fn add(&mut self, pose: &PoseHeader) {
        if pose.item.is(flag::BREAK) {
            *self = Self::default();
            return;
        }
        let motion = pose.motion.motion();
        self.length_m += length_m(&motion);
        self.motions.push_back(motion);
        while let Some(first) = self.motions.front()
            && (self.motions.len() > MAX_MOTIONS || self.length_m - length_m(first) >= STRETCH_M)
        {
            self.length_m -= length_m(first);
            self.motions.pop_front();
        }
    }

    pub fn drift(&self) -> Option<Drift> {
        let first = ComposedMotion::of(self.motions.front()?);
        let rest = self.motions.iter().skip(1);
        let composed = rest.fold(first, |all, next| all.then(next)).motion;
        let covariance = composed.covariance;
        let (xx, yy) = (covariance[(0, 0)], covariance[(1, 1)]);
        let (mean, half) = (0.5 * (xx + yy), 0.5 * (xx - yy));
        let variance_m2 = mean + half.hypot(covariance[(0, 1)]);
        Some(Drift {
            over_m: self.length_m,
            position_m: variance_m2.max(0.0).sqrt(),
            yaw_rad: covariance[(2, 2)].max(0.0).sqrt(),
        })
    }
}

fn length_m(motion: &OdometryMotion) -> f64 {
    motion.motion.translation.vector.norm()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn pose(flags: u32) -> PoseHeader {
        let mut pose = PoseHeader::default();
        pose.item.flags = flags;
        pose.motion.x_m = 2.0;
        // xx, xy, x yaw, yy, y yaw, yaw yaw.
        pose.motion.covariance = [0.01, 0.0, 0.0, 0.04, 0.0, 0.0];
        pose.motion.drift_share = 1.0;
        pose
    }

    #[test]
    fn it_is_that_of_the_motions_of_the_last_hundred_metres() {
        let mut recent = RecentDrift::default();
        assert_eq!(recent.drift(), None);
        for _ in 0..30 {
            recent.add(&pose(0));
        }
        let drift = recent.drift().unwrap();
        assert!((drift.over_m - 60.0).abs() < 1e-9);
        assert!((drift.position_m - (30.0f64 * 0.04).sqrt()).abs() < 1e-9);
        assert_eq!(drift.yaw_rad, 0.0);
        for _ in 0..300 {
            recent.add(&pose(0));
        }
        let drift = recent.drift().unwrap();
        assert!((drift.over_m - 100.0).abs() < 1e-9);
        assert!((drift.position_m - (50.0f64 * 0.04).sqrt()).abs() < 1e-9);
        recent.add(&pose(flag::BREAK));
        assert_eq!(recent.drift(), None, "a chain begins anew");
    }
}
