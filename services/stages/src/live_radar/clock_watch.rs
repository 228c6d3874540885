//! The radar's clock against this host's: the stamp of the last azimuth of each scan, and the time
//! of its arrival.

use std::collections::VecDeque;

use gyre_contract::control::SensorClock;

/// Scans of the window: eight seconds at 4 Hz.
const WINDOW: usize = 32;
/// Scans that show a step of a clock and not a scan that was read late.
const STEADY: usize = 8;
/// The least step, ns: more than the delay of scans varies, and less than half a scan.
const STEP_NS: i64 = 20_000_000;

/// The differences host - radar of the last scans, which contain the delay of the network. The
/// smallest one is the offset of the clocks; later arrivals are jitter.
#[derive(Debug, Default)]
pub struct ClockWatch {
    differences_ns: VecDeque<i64>,
    steps: u64,
    /// The state that a dead source has left, until there is a scan.
    before: Option<SensorClock>,
}

impl ClockWatch {
    /// Continues to count after a dead source.
    pub fn resume(before: Option<SensorClock>) -> Self {
        Self {
            steps: before.map_or(0, |it| it.steps),
            before,
            ..Self::default()
        }
    }

    pub fn add(&mut self, stamp_ns: i64, arrival_ns: i64) {
        let difference_ns = arrival_ns.saturating_sub(stamp_ns);
        if let Some(step_ns) = self.step(difference_ns) {
            self.steps += 1;
            let (ms, so_far) = (step_ns as f64 * 1e-6, self.steps);
            tracing::warn!(
                so_far,
                "the clock of the radar or of this host was set: their difference has changed by {ms:.1} ms"
            );
            self.differences_ns.clear();
        }
        if self.differences_ns.len() == WINDOW {
            self.differences_ns.pop_front();
        }
        self.differences_ns.push_back(difference_ns);
    }

    /// Returns the step that a further difference shows. A scan cannot arrive too early, but one is
    /// often late, and so a difference has to stay large.
    fn step(&self, next_ns: i64) -> Option<i64> {
        let known = self.differences_ns.len();
        let before = known.checked_sub(STEADY - 1).filter(|it| *it > 0)?;
        let smallest = |from, to| self.differences_ns.range(from..to).min().copied();
        let (old_ns, new_ns) = (smallest(0, before)?, smallest(before, known)?.min(next_ns));
        let early_ns = next_ns - self.differences_ns.iter().min()?;
        match () {
            () if early_ns < -STEP_NS => Some(early_ns),
            () if new_ns - old_ns > STEP_NS => Some(new_ns - old_ns),
            () => None,
        }
    }

    /// `None` before the first scan of the run.
    pub fn state(&self) -> Option<SensorClock> {
        let mut sorted: Vec<i64> = self.differences_ns.iter().copied().collect();
        sorted.sort_unstable();
        let Some(&offset_ns) = sorted.first() else {
            return self.before;
        };
        Some(SensorClock {
            offset_ns,
            jitter_ns: sorted[sorted.len() * 9 / 10] - offset_ns,
            steps: self.steps,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;
    const TURN_NS: i64 = 250 * MS;

    /// The state after scans that arrive late by this, of a radar whose clock is behind by 5 ms.
    fn watched(scans: i64, late_ns: impl Fn(i64) -> i64) -> SensorClock {
        let mut watch = ClockWatch::default();
        for k in 0..scans {
            watch.add(k * TURN_NS, k * TURN_NS + 5 * MS + late_ns(k));
        }
        watch.state().unwrap()
    }

    #[test]
    fn the_smallest_difference_is_the_offset_and_later_arrivals_are_jitter() {
        let clock = watched(100, |k| k % 4 * MS);
        assert_eq!((clock.offset_ns, clock.jitter_ns), (5 * MS, 3 * MS));
        assert_eq!(clock.steps, 0);
    }

    #[test]
    fn a_clock_that_is_set_forward_or_back_is_a_step_and_the_new_offset_is_known() {
        for step_ns in [-3_600_000 * MS, -30 * MS, 30 * MS, 3_600_000 * MS] {
            let clock = watched(100, |k| if k < 50 { 0 } else { step_ns });
            assert_eq!(clock.steps, 1, "{step_ns}");
            assert_eq!(clock.offset_ns, 5 * MS + step_ns);
        }
    }

    #[test]
    fn a_source_that_is_started_again_has_the_state_of_the_one_before_until_its_first_scan() {
        let before = watched(20, |_| 0);
        let mut watch = ClockWatch::resume(Some(SensorClock { steps: 3, ..before }));
        assert_eq!(watch.state().map(|it| it.steps), Some(3));
        watch.add(0, 7 * MS);
        let clock = watch.state().unwrap();
        assert_eq!((clock.offset_ns, clock.steps), (7 * MS, 3));
    }

    #[test]
    fn scans_that_were_read_late_and_drift_are_no_steps() {
        let late = watched(100, |k| if (40..47).contains(&k) { 900 * MS } else { 0 });
        assert_eq!(late.steps, 0);
        // 100 ppm.
        assert_eq!(watched(2000, |k| k * TURN_NS / 10_000).steps, 0);
    }
}
