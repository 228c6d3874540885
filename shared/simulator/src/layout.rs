//! The dataset formats: names and folders of the images, the files beside them, and the instant of
//! a sweep that is the scan's time.
//!
//! Oxford Radar RobotCar: `radar/<us>.png`, one for each sweep, named by the time of its first
//! azimuth; `radar.timestamps`; and `gt/radar_odometry.csv`: the pose of each scan but the first in
//! the frame of the one before, at the middle of the sweeps, x forward, **y right, yaw clockwise**.
//!
//! Boreas and Boreas Road Trip: `radar/<us>.png` with Oxford's columns, named by the time of
//! azimuth `n / 2 - 1`, which is the scan's; and `applanix/radar_poses.csv`: the radar in
//! east-north-up at those times, its own frame x forward, **y right, z down**.

pub(crate) mod radiate;

use std::f64::consts::PI;

use crate::simulator::Simulator;

/// Time over which the yaw rate is taken, seconds.
const RATE_SPAN_S: f64 = 1e-3;

/// `radar.timestamps`: the name of each sweep and whether it is valid.
pub(crate) fn oxford_timestamps(simulator: &Simulator) -> String {
    (0..simulator.scans())
        .map(|i| format!("{} 1\n", simulator.time(i).start_us))
        .collect()
}

/// `gt/radar_odometry.csv`: source is the newer scan, destination the older. With nine decimals
/// instead of Oxford's six, since the ground truth is exact and should stay so when it is chained.
pub(crate) fn oxford_odometry_csv(simulator: &Simulator) -> String {
    let header = "source_timestamp,destination_timestamp,x,y,z,roll,pitch,yaw,\
                  source_radar_timestamp,destination_radar_timestamp\n";
    let row = |newer: usize| {
        let (source, destination) = (simulator.time(newer), simulator.time(newer - 1));
        let motion = simulator.pose(newer - 1).inverse() * simulator.pose(newer);
        // From y left, yaw counter-clockwise to y right, yaw clockwise.
        let (x, y, yaw) = (
            motion.translation.x,
            -motion.translation.y,
            -motion.rotation.angle(),
        );
        format!(
            "{},{},{x:.9},{y:.9},{zero:.9},{zero:.9},{zero:.9},{yaw:.9},{},{}\n",
            source.middle_us(),
            destination.middle_us(),
            source.start_us,
            destination.start_us,
            zero = 0.0,
        )
    };
    std::iter::once(header.to_owned())
        .chain((1..simulator.scans()).map(row))
        .collect()
}

pub(crate) fn boreas_stamp_us(simulator: &Simulator, index: usize) -> i64 {
    simulator
        .time(index)
        .stamp_us((simulator.sampling().azimuths / 2).saturating_sub(1))
}

pub(crate) fn boreas_poses_csv(simulator: &Simulator) -> String {
    let header = "GPSTime,easting,northing,altitude,vel_east,vel_north,vel_up,roll,pitch,heading,angvel_z,angvel_y,angvel_x\n";
    std::iter::once(header.to_owned())
        .chain((0..simulator.scans()).map(|index| boreas_row(simulator, index)))
        .collect()
}

/// With the sensor's z axis down (a roll of pi) the heading is the course, counter-clockwise from
/// east, while a left turn is negative about z.
fn boreas_row(simulator: &Simulator, index: usize) -> String {
    let (stamp_us, path) = (boreas_stamp_us(simulator, index), simulator.path());
    let time_s = simulator.time(index).drive_time_s(stamp_us);
    let (pose, velocity) = (path.pose(time_s), path.velocity(time_s));
    let (before, after) = (
        path.pose(time_s - RATE_SPAN_S / 2.0),
        path.pose(time_s + RATE_SPAN_S / 2.0),
    );
    let yaw_rate = before.rotation.rotation_to(&after.rotation).angle() / RATE_SPAN_S;
    let (east, north, heading) = (
        pose.translation.x,
        pose.translation.y,
        pose.rotation.angle(),
    );
    format!(
        "{stamp_us},{east:.9},{north:.9},{zero:.9},{:.9},{:.9},{zero:.9},{PI:.15},{zero:.9},{heading:.12},{:.9},{zero:.9},{zero:.9}\n",
        velocity.x,
        velocity.y,
        -yaw_rate,
        zero = 0.0,
    )
}
