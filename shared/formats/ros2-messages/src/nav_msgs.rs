//! `nav_msgs`: odometry and grids.

use gyre_samples::Sample;
use serde::{Deserialize, Serialize};

use crate::{
    builtin_interfaces::Time,
    definition::message,
    geometry_msgs::{Pose, PoseWithCovariance, TwistWithCovariance},
    std_msgs::Header,
};

/// The pose of a vehicle in the frame of the header, and its velocity in its own frame.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Odometry {
    /// Time and frame of the pose.
    pub header: Header,
    /// The vehicle's frame, which is the frame of the velocity.
    pub child_frame_id: String,
    pub pose: PoseWithCovariance,
    pub twist: TwistWithCovariance,
}
message!(
    Odometry,
    "nav_msgs",
    "std_msgs/Header header\nstring child_frame_id\ngeometry_msgs/PoseWithCovariance pose\n\
     geometry_msgs/TwistWithCovariance twist\n",
    [Header, PoseWithCovariance, TwistWithCovariance]
);

impl Odometry {
    /// Returns the speed ahead as a sample of the wheels, on the driver's clock: see
    /// [`Header::stamp_or`].
    pub fn sample(&self, received_ns: i64) -> Sample {
        let speed_mps = self.twist.twist.linear.x;
        Sample::speed(self.header.stamp_or(received_ns), speed_mps)
    }
}

/// Size and place of a grid.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MapMetaData {
    /// When the map was loaded.
    pub map_load_time: Time,
    /// Side of a cell, m.
    pub resolution: f32,
    /// Columns, along x.
    pub width: u32,
    /// Rows, along y.
    pub height: u32,
    /// The corner of the first cell, in the frame of the map.
    pub origin: Pose,
}
message!(
    MapMetaData,
    "nav_msgs",
    "builtin_interfaces/Time map_load_time\nfloat32 resolution\nuint32 width\nuint32 height\n\
     geometry_msgs/Pose origin\n",
    [Time, Pose]
);

/// A map of cells: 0 to 100 % occupied, or -1 for unknown.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct OccupancyGrid {
    /// Time and frame of the map.
    pub header: Header,
    pub info: MapMetaData,
    /// The cells by rows, from the origin on, as the bytes of an `int8`: 255 is -1.
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
}
message!(
    OccupancyGrid,
    "nav_msgs",
    "std_msgs/Header header\nMapMetaData info\nint8[] data\n",
    [Header, MapMetaData]
);
