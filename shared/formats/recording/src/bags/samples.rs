//! The samples of other sensors in a bag: of a gyro messages of the type `sensor_msgs/msg/Imu`, of
//! the wheels `nav_msgs/msg/Odometry` or `geometry_msgs/msg/TwistStamped`.

use std::path::Path;

use gyre_geometry::samples::{Sample, SampleKind};
use gyre_ros2_messages::{geometry_msgs::TwistStamped, nav_msgs::Odometry, sensor_msgs::Imu};

use crate::bags::{RecordingError, azimuths::of, bag::Bag, sensors::Sensor};

const GYRO: Sensor<Sample> = Sensor {
    section: SampleKind::Gyro.section(),
    measurements: "samples of the gyro",
    types: &[("sensor_msgs/msg/Imu", |it| {
        Ok(of::<Imu>(it)?.sample(it.log_ns))
    })],
};

const WHEELS: Sensor<Sample> = Sensor {
    section: SampleKind::Wheels.section(),
    measurements: "samples of the wheels",
    types: &[
        ("nav_msgs/msg/Odometry", |it| {
            Ok(of::<Odometry>(it)?.sample(it.log_ns))
        }),
        ("geometry_msgs/msg/TwistStamped", |it| {
            Ok(of::<TwistStamped>(it)?.sample(it.log_ns))
        }),
    ],
};

/// Reads all samples of a sensor on the topic of this name, else on the only topic of its types; in
/// the sensor's own axes and on the clock of its driver, in the order of the bag. `None` without
/// such a topic.
///
/// The topic of the wheels must be named: odometry may be of anything, as the radar's own in a bag
/// that Gyre has exported.
pub(crate) fn read(
    bag: &mut Bag,
    path: &Path,
    kind: SampleKind,
    wished: Option<&str>,
) -> Result<Option<Vec<Sample>>, RecordingError> {
    let sensor = match kind {
        SampleKind::Gyro => GYRO,
        SampleKind::Wheels => WHEELS,
    };
    if kind == SampleKind::Wheels && wished.is_none() {
        require_no_speeds(bag, path)?;
    }
    let found = sensor.read(bag, path, wished)?;
    Ok(found.map(|(_, samples)| samples))
}

fn require_no_speeds(bag: &Bag, path: &Path) -> Result<(), RecordingError> {
    let listed = WHEELS.listed(bag);
    if listed.is_empty() {
        return Ok(());
    }
    let reason = format!(
        "has speeds on {listed}: name the topic that is of wheels with wheels.topic, since odometry may be of anything, as the radar's own in a bag that Gyre has exported"
    );
    Err(RecordingError::unreadable(path, reason))
}
