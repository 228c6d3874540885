//! `visualization_msgs`: what viewers draw, as ROS 2 Humble and later have it.

use serde::{Deserialize, Serialize};

use crate::{
    builtin_interfaces::Duration,
    definition::message,
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
/// The action of a marker that is drawn.
pub const ADD: i32 = 0;
/// The action that removes all markers of the topic.
pub const DELETEALL: i32 = 3;

/// A point of a texture.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct UVCoordinate {
    /// From left to right, 0 to 1.
    pub u: f32,
    /// From the bottom to the top, 0 to 1.
    pub v: f32,
}
message!(
    UVCoordinate,
    "visualization_msgs",
    "float32 u\nfloat32 v\n",
    []
);

#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct MeshFile {
    /// The name of the file.
    pub filename: String,
    /// The bytes of the file.
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
}
message!(
    MeshFile,
    "visualization_msgs",
    "string filename\nuint8[] data\n",
    []
);

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Marker {
    pub header: Header,
    /// The namespace of `id`.
    pub ns: String,
    /// The number of the shape, which replaces an earlier one of the same number.
    pub id: i32,
    /// The type, such as [`CUBE`].
    pub r#type: i32,
    /// The action, such as [`ADD`].
    pub action: i32,
    /// The place and the directions of the sides.
    pub pose: Pose,
    /// The lengths of the sides, m.
    pub scale: Vector3,
    pub color: ColorRGBA,
    /// The time for which it is drawn; zero: until it is removed.
    pub lifetime: Duration,
    /// True to move it with its frame.
    pub frame_locked: bool,
    /// The points of a line or a list.
    pub points: Vec<Point>,
    /// A colour for each point.
    pub colors: Vec<ColorRGBA>,
    /// The name of a texture.
    pub texture_resource: String,
    pub texture: CompressedImage,
    /// The place of each point in the texture.
    pub uv_coordinates: Vec<UVCoordinate>,
    pub text: String,
    /// The name of a mesh.
    pub mesh_resource: String,
    pub mesh_file: MeshFile,
    /// True to draw the mesh with its own colours.
    pub mesh_use_embedded_materials: bool,
}
message!(
    Marker,
    "visualization_msgs",
    "std_msgs/Header header\nstring ns\nint32 id\nint32 type\nint32 action\ngeometry_msgs/Pose pose\n\
     geometry_msgs/Vector3 scale\nstd_msgs/ColorRGBA color\nbuiltin_interfaces/Duration lifetime\n\
     bool frame_locked\ngeometry_msgs/Point[] points\nstd_msgs/ColorRGBA[] colors\n\
     string texture_resource\nsensor_msgs/CompressedImage texture\nUVCoordinate[] uv_coordinates\n\
     string text\nstring mesh_resource\nMeshFile mesh_file\nbool mesh_use_embedded_materials\n",
    [
        Header,
        Pose,
        Vector3,
        ColorRGBA,
        Duration,
        Point,
        CompressedImage,
        UVCoordinate,
        MeshFile
    ]
);

#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct MarkerArray {
    /// The shapes, in the order of drawing or removal.
    pub markers: Vec<Marker>,
}
message!(
    MarkerArray,
    "visualization_msgs",
    "Marker[] markers\n",
    [Marker]
);
