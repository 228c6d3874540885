//! Stamps on the clock of ROS.

use std::ops::Range;

/// 2001-01-01, and the last second that ROS 2 can write, ns since 1970.
const YEARS_NS: Range<i64> = 978_307_200_000_000_000..(i32::MAX as i64) * 1_000_000_000;

/// Returns the offset from the stamps of a run to times of ROS, which count from 1970. The stamps
/// of a radar or a recording that has the time are left unchanged. All other stamps get the same
/// offset, so that the first stamp is the present time: intervals stay as the sensor measured them.
pub fn offset_ns(first_ns: i64, now_ns: i64) -> i64 {
    match YEARS_NS.contains(&first_ns) {
        true => 0,
        false => now_ns.saturating_sub(first_ns),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NOW_NS: i64 = 1_800_000_000_000_000_000;

    #[test]
    fn stamps_since_1970_are_the_sensors_and_others_begin_now() {
        assert_eq!(offset_ns(1_549_981_914_123_456_789, NOW_NS), 0);
        for first_ns in [0, 2_000_000_000, -1, i64::MAX] {
            let offset_ns = offset_ns(first_ns, NOW_NS);
            assert_eq!(first_ns.saturating_add(offset_ns), NOW_NS);
        }
    }
}
