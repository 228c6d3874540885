//! `std_msgs`: the header of stamped messages, and colours.

use crate::{builtin_interfaces::Time, definition::package};

package! { std_msgs:
    struct Header {
        stamp: Time = "builtin_interfaces/Time stamp",
        frame_id: String = "string frame_id",
    }

    /// A colour, each part 0 to 1.
    #[derive(Copy)]
    struct ColorRGBA {
        r: f32 = "float32 r",
        g: f32 = "float32 g",
        b: f32 = "float32 b",
        a: f32 = "float32 a",
    }
}

impl Header {
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
