//! `sensor_msgs`: images.

use serde::{Deserialize, Serialize};

use crate::{definition::message, std_msgs::Header};

/// An image.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Image {
    /// Time and frame.
    pub header: Header,
    /// Rows.
    pub height: u32,
    /// Columns.
    pub width: u32,
    /// The encoding of a pixel, such as `mono8` or `8UC1`.
    pub encoding: String,
    /// 1 if pixels of several bytes are big-endian.
    pub is_bigendian: u8,
    /// Bytes of a row.
    pub step: u32,
    /// The pixels by rows.
    #[serde(with = "serde_bytes")]
    pub data: Vec<u8>,
}
message!(
    Image,
    "sensor_msgs",
    "std_msgs/Header header\nuint32 height\nuint32 width\nstring encoding\nuint8 is_bigendian\n\
     uint32 step\nuint8[] data\n",
    [Header]
);
