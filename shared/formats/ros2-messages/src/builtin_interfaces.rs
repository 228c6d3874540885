//! `builtin_interfaces`: times and durations.

use serde::{Deserialize, Serialize};

use crate::definition::message;

const SECOND_NS: i64 = 1_000_000_000;

/// A time since 1970.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Time {
    /// Seconds.
    pub sec: i32,
    /// Nanoseconds of the second.
    pub nanosec: u32,
}
message!(
    Time,
    "builtin_interfaces",
    "int32 sec\nuint32 nanosec\n",
    []
);

impl Time {
    /// Returns a time in ns since 1970. It ends in 2038, as ROS 2's does.
    pub fn from_ns(stamp_ns: i64) -> Self {
        let limits = i64::from(i32::MIN)..=i64::from(i32::MAX);
        let sec = stamp_ns.div_euclid(SECOND_NS);
        Self {
            sec: sec.clamp(*limits.start(), *limits.end()) as i32,
            nanosec: stamp_ns.rem_euclid(SECOND_NS) as u32,
        }
    }

    /// Returns the time in ns since 1970.
    pub fn ns(self) -> i64 {
        i64::from(self.sec) * SECOND_NS + i64::from(self.nanosec)
    }
}

/// A time between two times.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
pub struct Duration {
    /// Seconds.
    pub sec: i32,
    /// Nanoseconds of the second.
    pub nanosec: u32,
}
message!(
    Duration,
    "builtin_interfaces",
    "int32 sec\nuint32 nanosec\n",
    []
);
