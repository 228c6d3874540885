//! The pace of playback.

use gyre_transport::clock;

/// Maps sensor time to run time: `due = start + (complete - first) / rate`.
#[derive(Clone, Copy)]
pub(super) struct Pace {
    pub rate: f64,
    /// A time of the run, and the time of the sensor that it stands for, both in ns.
    pub origin: (i64, i64),
}

impl Pace {
    pub fn due_ns(&self, complete_ns: i64) -> i64 {
        let (start_ns, first_ns) = self.origin;
        start_ns.saturating_add((complete_ns.saturating_sub(first_ns) as f64 / self.rate) as i64)
    }

    /// Makes a scan after a break due one period after the scan before the break.
    pub fn resume(&mut self, before_ns: i64, complete_ns: i64, period_ns: i64) {
        let start_ns = self.due_ns(before_ns.saturating_add(period_ns));
        self.origin = (start_ns, complete_ns);
    }

    /// Delays the playback if a scan is late, so that it is due now. Returns the delay, ns.
    pub fn slip(&mut self, complete_ns: i64) -> u64 {
        let late_ns = clock::now_ns()
            .saturating_sub(self.due_ns(complete_ns))
            .max(0);
        self.origin.0 = self.origin.0.saturating_add(late_ns);
        late_ns as u64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_rate_scales_the_sensors_clock_and_a_scan_after_a_break_is_due_a_period_later() {
        let year_ns = 31_536_000_000_000_000;
        for complete_ns in [9_000_000_000 + year_ns, 9_000_000_000 - year_ns] {
            let mut pace = Pace {
                rate: 2.0,
                origin: (1000, 500),
            };
            assert_eq!(pace.due_ns(500 + 4000), 3000);
            pace.resume(500 + 8000, complete_ns, 400);
            assert_eq!(pace.due_ns(complete_ns), 1000 + 4000 + 200);
            assert_eq!(pace.due_ns(complete_ns + 400), 1000 + 4000 + 400);
        }
    }

    #[test]
    fn playback_slips_by_the_delay_of_a_late_scan_and_by_no_more() {
        let start_ns = clock::now_ns() - 1_000_000_000;
        let mut pace = Pace {
            rate: 1.0,
            origin: (start_ns, 0),
        };
        assert!(pace.slip(500_000_000) >= 500_000_000);
        assert!(pace.due_ns(500_000_000) <= clock::now_ns());
        assert_eq!(pace.slip(10_000_000_000), 0);
    }
}
