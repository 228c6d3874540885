//! The time when a scan was complete by the radar's clock, on this host's clock. So the latency of
//! a scan includes its time in the buffers of a late source.

/// Scans of a window. The smallest difference of the clocks comes from this window and the one
/// before: 8 to 16 s at 4 Hz, during which two clocks of 100 ppm drift apart by 1.6 ms. The
/// supervisor kills a source that stands still for longer.
const WINDOW: usize = 32;
/// Scans after which the pace of the radar's clock is known.
const MIN_PACES: usize = 3;
/// The largest difference between the radar's pace and this host's, as a share: less than for a
/// recording played at a different pace, and more than the variation on a busy machine.
const MAX_PACE_ERROR: f64 = 0.1;

/// Compares the clocks of the radar and of this host at the last azimuth of each scan.
///
/// The scan that was read with the least delay has the smallest difference host - radar. That scan
/// was due when it was read; others were due earlier by as much as their difference is larger.
#[derive(Clone, Debug, Default)]
pub struct ReadDelay {
    last: Option<(i64, i64)>,
    /// Time of this host per time of the radar, between the last scans; the oldest is overwritten.
    paces: Vec<f64>,
    scans: usize,
    /// The smallest differences of the window before and of this one, ns.
    smallest_ns: [Option<i64>; 2],
}

impl ReadDelay {
    /// Adds a scan that was complete at `stamp_ns` of the radar's clock and was read at `read_ns`,
    /// `CLOCK_MONOTONIC`. Returns when it was complete, `CLOCK_MONOTONIC`, ns; `None` for the first
    /// scans, and where the radar's clock has another pace, as in a recording.
    pub fn add(&mut self, stamp_ns: i64, read_ns: i64) -> Option<i64> {
        if let Some((before_ns, before_read_ns)) = self.last.replace((stamp_ns, read_ns)) {
            let elapsed_ns = stamp_ns.saturating_sub(before_ns);
            if elapsed_ns <= 0 {
                // It was set back.
                *self = Self {
                    last: self.last,
                    ..Self::default()
                };
            } else {
                let read = read_ns.saturating_sub(before_read_ns) as f64;
                let pace = read / elapsed_ns as f64;
                match self.paces.len() {
                    WINDOW => self.paces[self.scans % WINDOW] = pace,
                    _ => self.paces.push(pace),
                }
            }
        }
        if self.scans.is_multiple_of(WINDOW) {
            self.smallest_ns = [self.smallest_ns[1], None];
        }
        self.scans += 1;
        let difference_ns = read_ns.saturating_sub(stamp_ns);
        let smallest = |of: Option<i64>| of.map_or(difference_ns, |it| it.min(difference_ns));
        let smallest_ns = smallest(self.smallest_ns.into_iter().flatten().min());
        self.smallest_ns[1] = Some(smallest(self.smallest_ns[1]));
        let pace = self.pace()?;
        let is_alike = (pace - 1.0).abs() <= MAX_PACE_ERROR;
        is_alike.then(|| stamp_ns.saturating_add(smallest_ns))
    }

    /// Returns the median of this host's time per the radar's: after a source stood still, one is
    /// large and some after it are small.
    pub fn pace(&self) -> Option<f64> {
        let mut paces = [0.0; WINDOW];
        let paces = &mut paces[..self.paces.len()];
        paces.copy_from_slice(&self.paces);
        paces.sort_by(f64::total_cmp);
        (paces.len() >= MIN_PACES).then(|| paces[paces.len() / 2])
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const TURN_NS: i64 = 250_000_000;
    /// The radar counts from another year.
    const AHEAD_NS: i64 = 1_700_000_000_000_000_000;
    const MS: i64 = 1_000_000;

    /// Returns the known delays. The radar's clock is `pace` times as fast as the host's.
    fn delays(pace: f64, read_late_ns: impl Fn(i64) -> i64) -> Vec<Option<i64>> {
        let mut delay = ReadDelay::default();
        let scan = |k: i64| {
            let due_ns = (k * TURN_NS) as f64;
            let read_ns = due_ns as i64 + read_late_ns(k);
            let stamp_ns = AHEAD_NS + (due_ns * pace) as i64;
            delay.add(stamp_ns, read_ns).map(|due_ns| read_ns - due_ns)
        };
        (0..200).map(scan).collect()
    }

    #[test]
    fn a_scan_was_due_before_it_was_read_by_as_long_as_the_source_stood_still() {
        // It does from scan 50 on, for ten turns; then it reads all at once.
        let late_ns = |k| match k {
            50..60 => (60 - k) * TURN_NS,
            _ => MS,
        };
        let delays = delays(1.0, late_ns);
        assert_eq!(delays[..3], [None; 3]);
        for (k, delay_ns) in delays.iter().enumerate().skip(3) {
            let expected_ns = late_ns(k as i64) - MS;
            let error_ns = delay_ns.unwrap_or(i64::MAX) - expected_ns;
            assert!((0..100).contains(&error_ns), "scan {k}: {delay_ns:?}");
        }
    }

    #[test]
    fn clocks_that_drift_apart_are_followed() {
        for pace in [1.0 - 1e-4, 1.0 + 1e-4] {
            for delay_ns in delays(pace, |_| 0).into_iter().skip(3) {
                let delay_ns = delay_ns.unwrap_or(i64::MAX);
                assert!((0..=17 * MS / 10).contains(&delay_ns), "{pace}: {delay_ns}");
            }
        }
    }

    #[test]
    fn nothing_is_said_of_a_recording_that_is_played_at_another_pace() {
        for pace in [0.5, 0.9, 1.5, 4.0] {
            assert_eq!(delays(pace, |k| k % 3 * MS), [None; 200], "{pace}");
        }
    }

    #[test]
    fn a_clock_that_is_set_back_makes_no_scan_late() {
        let mut delay = ReadDelay::default();
        for k in 0..20 {
            delay.add(AHEAD_NS + k * TURN_NS, k * TURN_NS);
        }
        let later = |k: i64| delay.add(k * TURN_NS, k * TURN_NS);
        let late: Vec<_> = (20..40).map(later).collect();
        for (due_ns, k) in late.iter().zip(20..) {
            assert!(due_ns.is_none_or(|ns| ns == k * TURN_NS), "{k}");
        }
        assert!(late[5].is_some());
    }
}
