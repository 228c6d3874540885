//! Counts of scans and motions.

use gyre_contract::{Basis, Item, MotionEstimate, PoseHeader, flag, initial_guess, outcome};
use serde::Serialize;

use super::sensors::{SensorCounter, SensorCounts, too_many};

/// Largest share of unreadable scans of a run that succeeds. With more, motions span more than one
/// scan too often for the trajectory to be the recording's.
const MAX_UNREADABLE_SHARE: f64 = 0.2;

/// Largest share of motions without a firm match in a run that succeeds.
const MAX_UNSURE_SHARE: f64 = 0.2;

/// The radar's period is estimated from this many motions, so that longer runs take no more memory.
const MOTIONS_OF_PERIOD: usize = 1 << 16;

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Counts {
    pub published: u64,
    pub processed: u64,
    pub dropped: u64,
    pub unreadable: u64,
    /// Scans that the recording lacks, by the gaps in its times.
    pub missing: u64,
    /// Places where the chain of motions restarts, after the first.
    pub breaks: u64,
    /// Commands that have changed poses; `None`: the run has had none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub commands: Option<u64>,
    /// `None`: no scan has lost azimuths, or they were not looked for.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub lost: Option<LostCounts>,
    /// `None`: the run refines no motions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motions: Option<MotionCounts>,
    #[serde(flatten)]
    pub sensors: SensorCounts,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Course {
    pub path_m: f64,
    /// Time from the first pose to the last one, s.
    pub duration_s: f64,
    /// Time between two scans of the radar, s; `None` without motions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub period_s: Option<f64>,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct LostCounts {
    pub scans: u64,
    pub azimuths: u64,
    /// Azimuths in bursts at unknown places.
    pub unplaced: u64,
}

impl LostCounts {
    fn add(&mut self, item: &Item) {
        let lost = item.lost_azimuths();
        self.scans += u64::from(lost.count() > 0);
        self.azimuths += lost.count() as u64;
        self.unplaced += lost.unplaced() as u64;
    }
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct MotionCounts {
    pub refined: u64,
    pub weak: u64,
    pub predicted: u64,
    pub doubtful: u64,
    /// Weak ones, and predicted ones whose distance neither wheels nor Doppler measured.
    pub unsure: u64,
    /// Refined ones whose initial guess was not the prediction.
    pub second_hypothesis: u64,
    pub stationary: u64,
    /// Motions along walls without structure, where the radar does not observe the distance:
    /// wheels, Doppler or earlier motions determine it.
    pub along_walls: u64,
}

impl MotionCounts {
    fn add(&mut self, motion: &MotionEstimate) {
        let refinement = &motion.refinement;
        match refinement.outcome {
            outcome::REFINED => {
                self.refined += 1;
                let predictions = [initial_guess::PREDICTION, initial_guess::ALONG_WALLS];
                self.second_hypothesis +=
                    u64::from(!predictions.contains(&refinement.initial_guess));
            }
            outcome::WEAK => self.weak += 1,
            outcome::PREDICTED => self.predicted += 1,
            _ => {}
        }
        self.doubtful = self.weak + self.predicted;
        let is_unsure = refinement.outcome == outcome::WEAK || refinement.basis() == Basis::Guessed;
        self.unsure += u64::from(is_unsure);
        self.stationary += u64::from(refinement.is_stationary());
        self.along_walls += u64::from(refinement.initial_guess == initial_guess::ALONG_WALLS);
    }
}

impl Counts {
    /// Returns the counts of motions if too many have no firm match.
    pub fn too_many_are_unsure(&self) -> Option<&MotionCounts> {
        let motions = self.motions.as_ref();
        motions.filter(|it| too_many(it.unsure, it.refined + it.doubtful, MAX_UNSURE_SHARE))
    }

    /// Returns whether the result is hardly one of the recording.
    pub fn too_many_are_unreadable(&self) -> bool {
        let read = self.published + self.unreadable;
        self.unreadable as f64 > MAX_UNREADABLE_SHARE * read as f64
    }
}

#[derive(Debug, Default)]
pub struct Counter {
    processed: u64,
    starts: u64,
    first_ns: Option<i64>,
    last: Option<Item>,
    gaps: Gaps,
    lost: LostCounts,
    motions: MotionCounts,
    sensors: SensorCounter,
}

impl Counter {
    pub fn add(&mut self, pose: &PoseHeader) {
        self.processed += 1;
        self.starts += u64::from(pose.item.is(flag::BREAK));
        self.first_ns = self.first_ns.or(Some(pose.item.stamp_ns));
        self.last = Some(pose.item);
        self.gaps.add(pose);
        self.lost.add(&pose.item);
        self.motions.add(&pose.motion);
        self.sensors.add(pose);
    }

    pub fn course(&mut self, path_m: f64) -> Course {
        let span_ns = |(first_ns, last): (i64, Item)| last.stamp_ns - first_ns;
        let duration_ns = self.first_ns.zip(self.last).map_or(0, span_ns);
        Course {
            path_m,
            duration_s: duration_ns as f64 * 1e-9,
            period_s: self.gaps.period_ns().map(|ns| ns as f64 * 1e-9),
        }
    }

    /// Returns the counts, with the end of the stream if it came to that. `first` is the first scan
    /// played.
    pub fn counts(self, end: Option<&Item>, first: usize, refines: bool) -> Counts {
        let last = self.last.as_ref();
        let next = |of: fn(&Item) -> u64| end.map(of).or(last.map(|last| of(last) + 1));
        let published = next(|item| item.published).unwrap_or(0);
        let seen = next(|item| item.scan).map_or(0, |next| next.saturating_sub(first as u64));
        Counts {
            published,
            processed: self.processed,
            dropped: end.or(last).map_or(0, Item::dropped),
            unreadable: seen.saturating_sub(published),
            missing: self.gaps.missing(),
            breaks: self.starts.saturating_sub(1),
            commands: last.map(|last| last.commands).filter(|it| *it > 0),
            lost: (self.lost.scans > 0).then_some(self.lost),
            motions: refines.then_some(self.motions),
            sensors: self.sensors.counts(),
        }
    }
}

#[derive(Debug, Default)]
struct Gaps {
    first: Vec<Motion>,
    period_ns: Option<i64>,
    missing: u64,
}

/// The time that a motion takes, ns, and the turns of the radar in it by the numbers of its scans.
type Motion = (i64, u64);

fn missing_within(&(interval_ns, turns): &Motion, period_ns: i64) -> u64 {
    let fit = (interval_ns as f64 / period_ns as f64).round() as u64;
    fit.saturating_sub(turns)
}

impl Gaps {
    fn add(&mut self, pose: &PoseHeader) {
        if pose.item.is(flag::BREAK) {
            return;
        }
        let turns = pose.item.scan.saturating_sub(pose.item.previous_scan);
        let motion = (pose.motion.interval_ns, turns.max(1));
        match self.period_ns {
            Some(period_ns) => self.missing += missing_within(&motion, period_ns),
            None => {
                self.first.push(motion);
                if self.first.len() == MOTIONS_OF_PERIOD {
                    self.settle();
                }
            }
        }
    }

    /// Takes the median of the first motions' periods, and counts missing scans among them.
    fn settle(&mut self) {
        let period = |motion: &Motion| motion.0 / motion.1 as i64;
        let mut periods: Vec<i64> = self.first.iter().map(period).collect();
        periods.sort_unstable();
        let median = periods.get(periods.len() / 2).copied();
        if let Some(period_ns) = median.filter(|period_ns| *period_ns > 0) {
            let missing = self.first.iter().map(|it| missing_within(it, period_ns));
            self.missing += missing.sum::<u64>();
            self.period_ns = Some(period_ns);
        }
        self.first.clear();
    }

    fn period_ns(&mut self) -> Option<i64> {
        if self.period_ns.is_none() {
            self.settle();
        }
        self.period_ns
    }

    fn missing(mut self) -> u64 {
        self.period_ns();
        self.missing
    }
}

#[cfg(test)]
mod tests {
    use gyre_contract::{RefinementRecord, Witness, verdict};
    use gyre_geometry::LostAzimuths;

    use super::*;

    fn counted(poses: &[PoseHeader]) -> Counter {
        let mut counter = Counter::default();
        poses.iter().for_each(|pose| counter.add(pose));
        counter
    }

    #[test]
    fn every_scan_is_accounted_for() {
        let pose = |seq, published, scan| {
            let mut pose = PoseHeader::default();
            (pose.item.seq, pose.item.published, pose.item.scan) = (seq, published, scan);
            pose
        };
        let end = pose(3, 9, 15).item;
        let poses = [pose(0, 0, 5), pose(1, 3, 8), pose(2, 7, 13)];
        let counts = counted(&poses).counts(Some(&end), 5, false);
        let expected = Counts {
            published: 9,
            processed: 3,
            dropped: 6,
            unreadable: 1,
            ..Counts::default()
        };
        assert_eq!(counts, expected);
    }

    #[test]
    fn lost_azimuths_count_where_there_are_any() {
        let pose = |lost: &[[u16; 3]]| {
            let mut pose = PoseHeader::default();
            let lost = LostAzimuths::of_gaps(lost.iter().copied());
            pose.item.set_lost_azimuths(&lost);
            pose
        };
        let bursts = [[1, 1, 1], [7, 8, 12], [70, 99, 9]];
        let poses = [pose(&[]), pose(&[[3, 99, 1]]), pose(&bursts)];
        let lost = LostCounts {
            scans: 2,
            azimuths: 23,
            unplaced: 9,
        };
        assert_eq!(counted(&poses).counts(None, 0, false).lost, Some(lost));
        assert_eq!(counted(&poses[..1]).counts(None, 0, false).lost, None);
    }

    #[test]
    fn weak_and_predicted_motions_are_doubtful() {
        let pose = |(outcome, initial_guess)| {
            let mut pose = PoseHeader::default();
            pose.motion.refinement = RefinementRecord {
                outcome,
                initial_guess,
                stationary: u64::from(outcome == outcome::WEAK),
                ..RefinementRecord::default()
            };
            let wheels = pose.motion.refinement.of_mut(Witness::Wheels);
            wheels.verdict = u64::from(initial_guess == initial_guess::SEARCH) * verdict::USED;
            pose
        };
        let poses = [
            (outcome::SEARCHED, initial_guess::NONE),
            (outcome::REFINED, initial_guess::PREDICTION),
            (outcome::REFINED, initial_guess::SEARCH),
            (outcome::REFINED, initial_guess::YAW_OFFSET),
            (outcome::REFINED, initial_guess::ALONG_WALLS),
            (outcome::WEAK, initial_guess::SEARCH),
            (outcome::PREDICTED, initial_guess::NONE),
            (outcome::PREDICTED, initial_guess::SEARCH),
        ];
        let counts = counted(&poses.map(pose)).counts(None, 0, true);
        let expected = MotionCounts {
            refined: 4,
            weak: 1,
            predicted: 2,
            doubtful: 3,
            unsure: 2,
            second_hypothesis: 2,
            stationary: 1,
            along_walls: 1,
        };
        assert_eq!(counts.motions, Some(expected));
    }

    fn pose(scan: u64, previous_scan: u64, interval_ms: i64) -> PoseHeader {
        let mut pose = PoseHeader::default();
        (pose.item.scan, pose.item.previous_scan) = (scan, previous_scan);
        pose.item.flags = if scan == 0 { flag::BREAK } else { 0 };
        pose.motion.interval_ns = interval_ms * 1_000_000;
        pose
    }

    #[test]
    fn scans_that_the_recording_lacks_show_in_its_times_and_skipped_ones_do_not_count() {
        let missing = |poses: &[PoseHeader]| counted(poses).gaps.missing();
        let poses = [
            (0, 0, 0),
            (1, 0, 251),
            (2, 1, 249),
            (4, 2, 500),
            (5, 4, 250),
        ];
        let mut poses = poses.map(|(a, b, ms)| pose(a, b, ms)).to_vec();
        assert_eq!(missing(&poses), 0);
        poses.extend([pose(6, 5, 500), pose(8, 6, 1_000)]);
        assert_eq!(missing(&poses), 1 + 2);
        assert_eq!(missing(&poses[..1]), 0);
    }

    #[test]
    fn gaps_of_a_long_run_are_counted_in_bounded_memory() {
        let scans = 3 * MOTIONS_OF_PERIOD as u64;
        let interval_ms = |scan| if scan % 1000 == 999 { 750 } else { 250 };
        let pose = |scan: u64| pose(scan, scan.saturating_sub(1), interval_ms(scan));
        let poses: Vec<_> = (0..scans).map(pose).collect();
        let counter = counted(&poses);
        assert!(counter.gaps.first.is_empty());
        assert_eq!(counter.gaps.missing(), 2 * (scans / 1000));
    }
}
