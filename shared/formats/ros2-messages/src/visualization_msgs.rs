//! `visualization_msgs`: what viewers draw, as ROS 2 Humble and later have it.

use crate::{
    builtin_interfaces::Duration,
    definition::package,
    geometry_msgs::{Point, Pose, Vector3},
    sensor_msgs::CompressedImage,
    std_msgs::{ColorRGBA, Header},
};

/// The type of a marker that is an arrow along its x axis, as long as `scale.x`.
pub const ARROW: i32 = 0;
/// The type of a marker that is a box with the sides `scale`.
pub const CUBE: i32 = 1;
/// The type of a marker that is a text, whose letters are as high as `scale.z`.
pub const TEXT_VIEW_FACING: i32 = 9;
/// The action that removes all markers of the topic. Zero draws a marker.
pub const DELETEALL: i32 = 3;

package! { visualization_msgs:
    #[derive(Copy)]
    struct UVCoordinate {
        u: f32 = "float32 u",
        v: f32 = "float32 v",
    }

    struct MeshFile {
        filename: String = "string filename",
        #[serde(with = "serde_bytes")]
        data: Vec<u8> = "uint8[] data",
    }

    struct Marker {
        header: Header = "std_msgs/Header header",
        /// The namespace of `id`.
        ns: String = "string ns",
        /// The number of the shape, which replaces an earlier one of the same number.
        id: i32 = "int32 id",
        r#type: i32 = "int32 type",
        action: i32 = "int32 action",
        pose: Pose = "geometry_msgs/Pose pose",
        /// The lengths of the sides, m.
        scale: Vector3 = "geometry_msgs/Vector3 scale",
        color: ColorRGBA = "std_msgs/ColorRGBA color",
        /// The time for which it is drawn; zero: until it is removed.
        lifetime: Duration = "builtin_interfaces/Duration lifetime",
        frame_locked: bool = "bool frame_locked",
        points: Vec<Point> = "geometry_msgs/Point[] points",
        colors: Vec<ColorRGBA> = "std_msgs/ColorRGBA[] colors",
        texture_resource: String = "string texture_resource",
        texture: CompressedImage = "sensor_msgs/CompressedImage texture",
        uv_coordinates: Vec<UVCoordinate> = "UVCoordinate[] uv_coordinates",
        text: String = "string text",
        mesh_resource: String = "string mesh_resource",
        mesh_file: MeshFile = "MeshFile mesh_file",
        mesh_use_embedded_materials: bool = "bool mesh_use_embedded_materials",
    }

    struct MarkerArray {
        markers: Vec<Marker> = "Marker[] markers",
    }
}
