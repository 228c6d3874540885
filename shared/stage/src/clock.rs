//! The clock that all hops are stamped with.

use std::time::Duration;

use rustix::time::{ClockId, clock_gettime};

/// `CLOCK_MONOTONIC`, ns: the same for all processes of one machine.
pub fn now_ns() -> i64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec * 1_000_000_000 + now.tv_nsec
}

/// From now until `due_ns`; zero when that has passed.
pub fn until(due_ns: i64) -> Duration {
    Duration::from_nanos(due_ns.saturating_sub(now_ns()).max(0) as u64)
}
