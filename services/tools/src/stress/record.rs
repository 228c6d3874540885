//! Poses in, distributions out.
//!
//! Every scan that was due is a sample. One that was dropped counts until the pose of the next one
//! that was not: the vehicle had no newer pose before that. So neither a drop nor a source that
//! stands still makes the distribution look better (coordinated omission).

use std::ops::Range;

use gyre_contract::{Item, PoseHeader, StageId, WitnessCounts, flag, run::latency::Durations};
use serde::Serialize;

/// The minimum number of samples for a 99th percentile: one is beyond it.
const LEAST: u64 = 100;
/// The minimum number for a firm one: ten are beyond it.
const FIRM: u64 = 1000;

/// The largest number of dropped scans between two poses that are recorded one by one.
const MAX_GAP: u64 = 1 << 20;

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    pub due: u64,
    pub posed: u64,
    /// Scans without a pose, including `never`.
    pub dropped: u64,
    /// Scans that no later pose has replaced when the measurement ended. They count as long as that
    /// took.
    pub never: u64,
    /// Poses that this observer has missed: they are neither posed nor dropped.
    pub unseen: u64,
}

/// Percentiles of a duration, ms, as far as the number of samples supports them.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Distribution {
    pub samples: u64,
    pub p50_ms: Option<f64>,
    pub p99_ms: Option<f64>,
    pub max_ms: Option<f64>,
}

impl Distribution {
    pub fn of(durations: &Durations) -> Self {
        let samples = durations.count();
        let at = |share: f64| durations.at(share).map(|ns| ns as f64 * 1e-6);
        Self {
            samples,
            p50_ms: at(0.5).filter(|_| samples >= 2),
            p99_ms: at(0.99).filter(|_| samples >= LEAST),
            max_ms: at(1.0),
        }
    }

    /// Returns ` of N` for a 99th percentile of N samples that depends on chance.
    pub fn p99_mark(&self) -> String {
        match self.p99_ms.is_some() && self.samples < FIRM {
            true => format!(" of {}", self.samples),
            false => String::new(),
        }
    }

    /// Returns a percentile to be judged: where there are too few samples for it, the maximum.
    pub fn judged(&self, percentile: Option<f64>) -> Option<f64> {
        percentile.or(self.max_ms)
    }
}

#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RunLatency {
    pub counts: Counts,
    /// From the time when a scan was due to its pose; a dropped scan counts until the pose that
    /// replaced it.
    pub sensor_to_pose: Distribution,
    /// The figure of a closed loop: from the publication of a scan to its pose.
    pub closed_loop: Distribution,
}

#[derive(Debug, Default)]
pub struct Recorder {
    /// `CLOCK_MONOTONIC`, ns.
    window: Range<i64>,
    /// Scans that become due at once.
    burst: u64,
    before: Option<Item>,
    counts: Counts,
    all: Durations,
    closed_loop: Durations,
    /// The basis of the motions in the first turn of the recording: where the recording starts
    /// again, the vehicle jumps.
    pub motions: WitnessCounts,
    /// The end of that turn: the number of the first scan that is not in it.
    turn_end: u64,
}

impl Recorder {
    /// Records the scans that are due within `window`, `CLOCK_MONOTONIC`, ns. `burst` scans become
    /// due at once.
    pub fn new(window: Range<i64>, burst: u64, turn_end: u64) -> Self {
        Self {
            window,
            burst,
            turn_end,
            ..Self::default()
        }
    }

    /// Adds the next pose; one that was added before is left out.
    pub fn add(&mut self, pose: &PoseHeader) {
        let item = &pose.item;
        let posed_ns = item.hops[StageId::PoseIntegration as usize].published_ns;
        if let Some(before) = self.before {
            if item.seq <= before.seq {
                return;
            }
            self.add_between(&before, item, posed_ns);
        }
        self.before = Some(*item);
        if !self.window.contains(&item.due_ns) {
            return;
        }
        self.counts.posed += 1;
        self.sample(item.due_ns, posed_ns);
        if !item.is(flag::BREAK) && item.scan < self.turn_end {
            self.motions.add(&pose.motion.refinement);
        }
        let published_ns = item.hops[StageId::RadarReplay as usize].published_ns;
        self.closed_loop.add(posed_ns - published_ns);
    }

    /// Adds the scans between two poses: a pose was missed for each number that `seq` lacks, and
    /// the rest was dropped.
    fn add_between(&mut self, before: &Item, item: &Item, posed_ns: i64) {
        let unseen = item.seq - before.seq - 1;
        let between = item.published.saturating_sub(before.published + 1);
        if self.window.contains(&item.due_ns) {
            self.counts.unseen += unseen;
        }
        // Where poses were missed it is not known which of them were dropped.
        let dropped = between.saturating_sub(unseen).min(MAX_GAP);
        for number in (item.published - dropped)..item.published {
            let due_ns = self.due_between(before, item, number);
            if self.window.contains(&due_ns) {
                self.counts.dropped += 1;
                self.sample(due_ns, posed_ns);
            }
        }
    }

    /// Returns when a scan between two others was due: bursts are evenly spaced.
    fn due_between(&self, before: &Item, item: &Item, number: u64) -> i64 {
        let burst = |number: u64| (number / self.burst) as f64;
        let (first, last) = (burst(before.published), burst(item.published));
        let share = (burst(number) - first) / (last - first).max(1.0);
        before.due_ns + ((item.due_ns - before.due_ns) as f64 * share) as i64
    }

    fn sample(&mut self, due_ns: i64, until_ns: i64) {
        self.counts.due += 1;
        self.all.add(until_ns - due_ns);
    }

    /// Returns whether a scan that was due in the time, one each `period_ns`, may still get its
    /// pose.
    pub fn owes(&self, period_ns: i64) -> bool {
        let newest = self.before.map(|item| item.due_ns);
        newest.is_some_and(|due_ns| due_ns.saturating_add(period_ns) < self.window.end)
    }

    /// Ends the recording at `now_ns`. Scans that were due, one each `period_ns`, and that no pose
    /// has replaced count until now.
    pub fn finish(mut self, period_ns: i64, now_ns: i64) -> RunLatency {
        let period_ns = period_ns.max(1);
        let before = self.before.map(|item| item.due_ns);
        let after = before.unwrap_or(self.window.start - period_ns);
        let mut due_ns = after.saturating_add(period_ns);
        while due_ns < self.window.end.min(now_ns) {
            if due_ns >= self.window.start {
                self.counts.dropped += 1;
                self.counts.never += 1;
                self.sample(due_ns, now_ns);
            }
            due_ns += period_ns;
        }
        RunLatency {
            counts: self.counts,
            sensor_to_pose: Distribution::of(&self.all),
            closed_loop: Distribution::of(&self.closed_loop),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const MS: i64 = 1_000_000;

    /// A pose of a scan that was due at `due_ms`, published `late_ms` after that, and has its pose
    /// 10 ms later.
    fn pose([seq, published]: [u64; 2], due_ms: i64, late_ms: i64) -> PoseHeader {
        let mut pose = PoseHeader::default();
        (pose.item.seq, pose.item.published) = (seq, published);
        pose.item.due_ns = due_ms * MS;
        let published_ns = (due_ms + late_ms) * MS;
        pose.item.hop_mut(StageId::RadarReplay).published_ns = published_ns;
        let sink = pose.item.hop_mut(StageId::PoseIntegration);
        sink.started_ns = published_ns;
        sink.finished_ns = published_ns + 9 * MS;
        sink.published_ns = published_ns + 10 * MS;
        pose
    }

    fn recorded(poses: &[PoseHeader], burst: u64, end_ms: i64) -> RunLatency {
        let mut recorder = Recorder::new(0..end_ms * MS, burst, u64::MAX);
        poses.iter().for_each(|pose| recorder.add(pose));
        recorder.finish(250 * MS, end_ms * MS)
    }

    /// The counts: due, posed, dropped, never and unseen.
    fn counts(recorded: &RunLatency) -> [u64; 5] {
        let it = recorded.counts;
        [it.due, it.posed, it.dropped, it.never, it.unseen]
    }

    fn near(a: Option<f64>, b: f64) -> bool {
        a.is_some_and(|a| (a - b).abs() <= 2e-3 * b)
    }

    #[test]
    fn a_source_that_stood_still_shows_although_its_service_time_does_not() {
        // The source stops for a second: scan 2 is published late, scans 3 to 5 are dropped.
        let (on_time, late) = ([pose([0, 0], 0, 0), pose([1, 1], 250, 0)], 1000);
        let after = [pose([2, 2], 500, late), pose([3, 6], 1500, 10)];
        let recorded = recorded(&[on_time, after].concat(), 1, 1600);
        assert!(near(recorded.sensor_to_pose.max_ms, 1010.0), "{recorded:?}");
        assert!(near(recorded.closed_loop.max_ms, 10.0));
        assert_eq!(counts(&recorded), [7, 4, 3, 0, 0]);
    }

    #[test]
    fn a_dropped_scan_counts_until_the_pose_that_replaces_it() {
        let recorded = recorded(&[pose([0, 0], 0, 0), pose([1, 4], 1000, 0)], 1, 1100);
        assert_eq!(counts(&recorded), [5, 2, 3, 0, 0]);
        // 10, 10, 260, 510 and 760 ms.
        assert!(near(recorded.sensor_to_pose.p50_ms, 260.0));
        assert!(near(recorded.sensor_to_pose.max_ms, 760.0));
    }

    #[test]
    fn scans_of_a_burst_are_due_at_once() {
        // Two bursts of three; of the second one the last alone has a pose.
        let recorded = recorded(&[pose([0, 2], 0, 0), pose([1, 5], 750, 0)], 3, 800);
        assert_eq!(recorded.counts.dropped, 2);
        assert!(near(recorded.sensor_to_pose.max_ms, 10.0));
    }

    #[test]
    fn scans_count_once_within_the_time_and_until_its_end_without_a_later_pose() {
        let alone = recorded(&[pose([0, 0], 0, 0)], 1, 1000);
        assert_eq!(counts(&alone), [4, 1, 3, 3, 0]);
        assert!(near(alone.sensor_to_pose.max_ms, 750.0));
        let again = pose([1, 1], 0, 0);
        let poses = [pose([0, 0], -250, 0), again, again, pose([2, 2], 250, 0)];
        assert_eq!(counts(&recorded(&poses, 1, 200))[..2], [1, 1]);
        // A pose that was missed is no dropped scan.
        let missed = recorded(&[pose([0, 0], 0, 0), pose([3, 4], 1000, 0)], 1, 1100);
        assert_eq!(counts(&missed), [3, 2, 1, 0, 2]);
    }

    #[test]
    fn a_percentile_needs_samples_and_one_that_rests_on_few_is_marked() {
        for (samples, p50_ms, p99_ms, judged_ms, mark) in [
            (0, None, None, None, ""),
            (99, Some(50.0), None, Some(99.0), ""),
            (100, Some(50.0), Some(99.0), Some(99.0), " of 100"),
            (1000, Some(500.0), Some(990.0), Some(990.0), ""),
        ] {
            let mut durations = Durations::default();
            (1..=samples).for_each(|ms| durations.add(ms * 1_000_000));
            let of = Distribution::of(&durations);
            let is = |found: Option<f64>, ms: Option<f64>| {
                found == ms || ms.is_some_and(|ms| near(found, ms))
            };
            assert!(is(of.p50_ms, p50_ms) && is(of.p99_ms, p99_ms), "{of:?}");
            assert!(is(of.judged(of.p99_ms), judged_ms), "{of:?}");
            assert_eq!(of.p99_mark(), mark);
        }
    }
}
