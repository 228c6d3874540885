//! Oxford Radar RobotCar: `radar/<us>.png`, one for each sweep, named by the time of its first
//! azimuth; `radar.timestamps`; and `gt/radar_odometry.csv`: the pose of each scan but the first in
//! the frame of the one before, at the middle of the sweeps, x forward, **y right, yaw clockwise**.

use super::SideFile;
use crate::simulator::Simulator;

pub(crate) fn file_name(simulator: &Simulator, index: usize) -> String {
    format!("{}.png", simulator.time(index).start_us)
}

pub(crate) fn side_files(simulator: &Simulator) -> Vec<SideFile> {
    vec![
        ("radar.timestamps", timestamps(simulator)),
        ("gt/radar_odometry.csv", radar_odometry_csv(simulator)),
    ]
}

/// `radar.timestamps`: the name of each sweep and whether it is valid.
fn timestamps(simulator: &Simulator) -> String {
    (0..simulator.scans())
        .map(|i| format!("{} 1\n", simulator.time(i).start_us))
        .collect()
}

/// `gt/radar_odometry.csv`: source is the newer scan, destination the older. With nine decimals
/// instead of Oxford's six, since the ground truth is exact and should stay so when it is chained.
fn radar_odometry_csv(simulator: &Simulator) -> String {
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
