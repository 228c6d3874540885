//! `builtin_interfaces`: times and durations.

use crate::definition::package;

const SECOND_NS: i64 = 1_000_000_000;

package! { builtin_interfaces:
    #[derive(Copy)]
    struct Time {
        sec: i32 = "int32 sec",
        nanosec: u32 = "uint32 nanosec",
    }

    #[derive(Copy)]
    struct Duration {
        sec: i32 = "int32 sec",
        nanosec: u32 = "uint32 nanosec",
    }
}

impl Time {
    /// Returns a time in ns since 1970. It ends in 2038, as ROS 2's does.
    pub fn from_ns(stamp_ns: i64) -> Self {
        let sec = stamp_ns.div_euclid(SECOND_NS);
        Self {
            sec: sec.clamp(i32::MIN.into(), i32::MAX.into()) as i32,
            nanosec: stamp_ns.rem_euclid(SECOND_NS) as u32,
        }
    }

    pub fn ns(self) -> i64 {
        i64::from(self.sec) * SECOND_NS + i64::from(self.nanosec)
    }
}
