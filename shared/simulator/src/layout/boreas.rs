//! Boreas and Boreas Road Trip: `radar/<us>.png` with Oxford's columns, named by the time of
//! azimuth `n / 2 - 1`, which is the scan's; and `applanix/radar_poses.csv`: the radar in
//! east-north-up at those times, its own frame x forward, **y right, z down**.

use std::f64::consts::PI;

use super::SideFile;
use crate::simulator::Simulator;

/// Time over which the yaw rate is taken, seconds.
const RATE_SPAN_S: f64 = 1e-3;

pub(crate) fn stamp_us(simulator: &Simulator, index: usize) -> i64 {
    simulator
        .time(index)
        .stamp_us((simulator.sampling().azimuths / 2).saturating_sub(1))
}

pub(crate) fn file_name(simulator: &Simulator, index: usize) -> String {
    format!("{}.png", stamp_us(simulator, index))
}

pub(crate) fn side_files(simulator: &Simulator) -> Vec<SideFile> {
    vec![("applanix/radar_poses.csv", radar_poses_csv(simulator))]
}

fn radar_poses_csv(simulator: &Simulator) -> String {
    let header = "GPSTime,easting,northing,altitude,vel_east,vel_north,vel_up,roll,pitch,heading,angvel_z,angvel_y,angvel_x\n";
    std::iter::once(header.to_owned())
        .chain((0..simulator.scans()).map(|index| row(simulator, index)))
        .collect()
}

/// With the sensor's z axis down (a roll of pi) the heading is the course, counter-clockwise from
/// east, while a left turn is negative about z.
fn row(simulator: &Simulator, index: usize) -> String {
    let (stamp_us, path) = (stamp_us(simulator, index), simulator.path());
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
