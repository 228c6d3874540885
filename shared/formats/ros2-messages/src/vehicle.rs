//! The vehicle that carries the radar: the messages of a run's poses.

use gyre_contract::{PoseHeader, flag, outcome};
use gyre_geometry::Pose;

use crate::{
    Mounting,
    frames::{self, Frames, Interval},
    nav_msgs::Odometry,
    tf2_msgs::TFMessage,
};

#[derive(Clone, Debug, PartialEq)]
pub struct Vehicle {
    pub frames: Frames,
    pub mounting: Mounting,
}

impl Vehicle {
    /// Returns the place of the radar on the vehicle.
    pub fn mounted(&self, stamp_ns: i64) -> TFMessage {
        let (base, radar) = (&self.frames.base, &self.frames.radar);
        let mounted = frames::transform(stamp_ns, base, radar, self.mounting.radar());
        TFMessage {
            transforms: vec![mounted],
        }
    }

    /// Returns a pose of the radar as odometry of the vehicle.
    pub fn odometry(&self, stamp_ns: i64, pose: &PoseHeader) -> Odometry {
        let motion = pose.motion.motion().alone();
        let since = Interval {
            motion: self.mounting.of_vehicle_uncertain(&motion),
            duration_ns: pose.motion.interval_ns,
            is_measured: pose.motion.refinement.outcome != outcome::PREDICTED,
        };
        let since = (!pose.item.is(flag::BREAK)).then_some(&since);
        let vehicle = self.mounting.of_vehicle_uncertain(&pose.pose());
        frames::odometry(stamp_ns, &self.frames, &vehicle, since)
    }

    /// Returns a pose of the radar as the transform of odometry, and with SLAM the correction by
    /// loops as the transform of the map.
    pub fn transforms(
        &self,
        stamp_ns: i64,
        pose: &PoseHeader,
        map_from_odometry: Option<&Pose>,
    ) -> TFMessage {
        let Frames {
            map, odom, base, ..
        } = &self.frames;
        let vehicle = self.mounting.of_vehicle(&pose.pose().motion);
        let mut transforms = vec![frames::transform(stamp_ns, odom, base, &vehicle)];
        transforms.extend(map_from_odometry.map(|correction| {
            let correction = self.mounting.of_vehicle(correction);
            frames::transform(stamp_ns, map, odom, &correction)
        }));
        TFMessage { transforms }
    }
}
