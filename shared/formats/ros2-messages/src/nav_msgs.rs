//! `nav_msgs`: odometry and grids.

use gyre_geometry::samples::Sample;

use crate::{
    builtin_interfaces::Time,
    definition::package,
    geometry_msgs::{Pose, PoseWithCovariance, TwistWithCovariance},
    std_msgs::Header,
};

package! { nav_msgs:
    /// The pose of the vehicle's frame `child_frame_id` in the frame of the header, and its
    /// velocity in its own frame.
    struct Odometry {
        header: Header = "std_msgs/Header header",
        child_frame_id: String = "string child_frame_id",
        pose: PoseWithCovariance = "geometry_msgs/PoseWithCovariance pose",
        twist: TwistWithCovariance = "geometry_msgs/TwistWithCovariance twist",
    }

    #[derive(Copy)]
    struct MapMetaData {
        map_load_time: Time = "builtin_interfaces/Time map_load_time",
        /// Side of a cell, m.
        resolution: f32 = "float32 resolution",
        /// Columns, along x.
        width: u32 = "uint32 width",
        /// Rows, along y.
        height: u32 = "uint32 height",
        /// The corner of the first cell, in the frame of the map.
        origin: Pose = "geometry_msgs/Pose origin",
    }

    /// A map of cells: 0 to 100 % occupied, or -1 for unknown.
    struct OccupancyGrid {
        header: Header = "std_msgs/Header header",
        info: MapMetaData = "MapMetaData info",
        /// The cells by rows, from the origin on, as the bytes of an `int8`: 255 is -1.
        #[serde(with = "serde_bytes")]
        data: Vec<u8> = "int8[] data",
    }
}

impl Odometry {
    /// Returns the speed ahead as a sample of the wheels, on the driver's clock: see
    /// [`Header::stamp_or`].
    pub fn sample(&self, received_ns: i64) -> Sample {
        let speed_mps = self.twist.twist.linear.x;
        Sample::speed(self.header.stamp_or(received_ns), speed_mps)
    }
}
