/// The longest time between consecutive scans of a chain of motions, ns. After that a moving
/// vehicle has left the reach of every search, and a prediction from its last velocity is
/// worthless.
pub const MAX_INTERVAL_NS: i64 = 10_000_000_000;

/// Returns whether the scan at `later_ns` continues the chain of motions of the scan at
/// `earlier_ns`: it is later, and by at most [`MAX_INTERVAL_NS`]. Otherwise there is a gap, or the
/// clock was set.
pub fn continues(earlier_ns: i64, later_ns: i64) -> bool {
    (1..=MAX_INTERVAL_NS).contains(&later_ns.saturating_sub(earlier_ns))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_chain_breaks_where_time_stands_still_runs_backwards_or_jumps() {
        let now = 1_547_131_046_000_000_000;
        assert!(continues(now, now + 1) && continues(now, now + MAX_INTERVAL_NS));
        for later in [now, now - 1, now + MAX_INTERVAL_NS + 1, i64::MIN, i64::MAX] {
            assert!(!continues(now, later), "{later}");
        }
    }
}
