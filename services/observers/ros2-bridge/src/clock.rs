//! Stamps on the clock of ROS.

use std::ops::Range;

use gyre_stage::clock;

/// 2001-01-01, and the last second that ROS 2 can write, ns since 1970.
const YEARS_NS: Range<i64> = 978_307_200_000_000_000..(i32::MAX as i64) * 1_000_000_000;

/// Converts the stamps of a run to times of ROS, which count from 1970. The stamps of a
/// radar or a recording that has the time are left unchanged. All other stamps get the same offset,
/// so that the first stamp is the present time: intervals stay as the sensor measured them.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Clock {
    offset_ns: i64,
}

impl Clock {
    /// Returns the clock of a run whose first stamp, received now, is this one.
    pub fn of(first_ns: i64) -> Self {
        Self::at(first_ns, clock::since_1970_ns())
    }

    fn at(first_ns: i64, now_ns: i64) -> Self {
        Self {
            offset_ns: match YEARS_NS.contains(&first_ns) {
                true => 0,
                false => now_ns.saturating_sub(first_ns),
            },
        }
    }

    /// Returns a time of the run, ns, as a time of ROS, ns since 1970.
    pub fn stamp_ns(self, time_ns: i64) -> i64 {
        time_ns.saturating_add(self.offset_ns)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW_NS: i64 = 1_800_000_000_000_000_000;

    #[test]
    fn stamps_since_1970_are_the_sensors() {
        let recorded_ns = 1_549_981_914_123_456_789;
        let clock = Clock::at(recorded_ns, NOW_NS);
        assert_eq!(clock.stamp_ns(recorded_ns + 5), recorded_ns + 5);
    }

    #[test]
    fn stamps_since_another_time_begin_now_and_keep_their_intervals() {
        for first_ns in [0, 2_000_000_000, -1, i64::MAX] {
            let clock = Clock::at(first_ns, NOW_NS);
            assert_eq!(clock.stamp_ns(first_ns), NOW_NS);
        }
        let clock = Clock::at(2_000_000_000, NOW_NS);
        assert_eq!(clock.stamp_ns(2_250_000_000), NOW_NS + 250_000_000);
    }
}
