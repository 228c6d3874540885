//! The clock of all time stamps.

use std::time::{Duration, SystemTime};

use rustix::time::{ClockId, clock_gettime};

/// Returns the time of `CLOCK_MONOTONIC`, ns. It is the same for all processes of a machine.
pub fn now_ns() -> i64 {
    let now = clock_gettime(ClockId::Monotonic);
    now.tv_sec * 1_000_000_000 + now.tv_nsec
}

pub fn since_1970_ns() -> i64 {
    let now = SystemTime::now().duration_since(SystemTime::UNIX_EPOCH);
    now.map_or(0, |now| now.as_nanos() as i64)
}

pub fn until(due_ns: i64) -> Duration {
    Duration::from_nanos(due_ns.saturating_sub(now_ns()).max(0) as u64)
}
