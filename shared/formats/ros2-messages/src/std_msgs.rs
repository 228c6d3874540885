//! `std_msgs`: the header of stamped messages, and colours.

use serde::{Deserialize, Serialize};

use crate::{builtin_interfaces::Time, definition::message};

/// Time and frame of a message.
#[derive(Clone, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Header {
    pub stamp: Time,
    /// The name of the frame.
    pub frame_id: String,
}
message!(
    Header,
    "std_msgs",
    "builtin_interfaces/Time stamp\nstring frame_id\n",
    [Time]
);

impl Header {
    /// Returns the header of a time in ns since 1970 and a frame.
    pub fn new(stamp_ns: i64, frame_id: &str) -> Self {
        Self {
            stamp: Time::from_ns(stamp_ns),
            frame_id: frame_id.to_owned(),
        }
    }

    /// Returns the time, ns since 1970; the time of receipt of a message whose driver sets no time.
    pub fn stamp_or(&self, received_ns: i64) -> i64 {
        match self.stamp.ns() {
            0 => received_ns,
            stamp_ns => stamp_ns,
        }
    }
}

/// A colour, each part 0 to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct ColorRGBA {
    /// Red.
    pub r: f32,
    pub g: f32,
    pub b: f32,
    pub a: f32,
}
message!(
    ColorRGBA,
    "std_msgs",
    "float32 r\nfloat32 g\nfloat32 b\nfloat32 a\n",
    []
);
