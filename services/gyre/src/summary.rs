//! `summary.json`, and the same as a table.

use std::{collections::BTreeMap, fmt, path::Path, time::Duration};

use gyre_masking::{MaskKind, MaskingConfig};
use gyre_messages::{Footprint, PoseHeader, StageId, flag, initial_guess, outcome};
use gyre_stage::{
    StageCounters,
    supervise::{Ending, Report},
};
use serde::Serialize;

use crate::{
    configuration::{Configuration, Mode, Rate},
    judgement::Judgement,
    latency::{Latency, Percentiles},
    machine::Machine,
};

/// Largest share of unreadable scans of a run that succeeds. With more, motions span more than one scan too often for
/// the trajectory to be the recording's.
const MAX_UNREADABLE_SHARE: f64 = 0.2;

/// This session of a run.
pub struct Session<'a> {
    /// Scans in the recording.
    pub scans: usize,
    /// Poses that were in the journal before.
    pub resumed: usize,
    /// Wall-clock time.
    pub wall: Duration,
    /// Shared memory; `None` if no process was started, because only results were missing.
    pub footprint: Option<&'a Footprint>,
    /// Its end; `None`: it failed.
    pub ending: Option<Ending>,
    /// The supervisor's report; `None` if it failed or no process was started.
    pub report: Option<&'a Report>,
}

/// Counts of scans.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct Counts {
    /// Scans that the source published.
    pub published: u64,
    /// Scans with a pose.
    pub processed: u64,
    /// Scans published and not processed: what live mode dropped.
    pub dropped: u64,
    /// Scans that could not be read.
    pub unreadable: u64,
    /// Scans that the recording lacks, by the gaps in its times.
    pub missing: u64,
    /// Places where the chain of motions starts anew, after the first.
    pub breaks: u64,
    /// `None`: the run refines no motions.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub motions: Option<MotionCounts>,
}

/// Counts of motions by outcome.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
pub struct MotionCounts {
    /// Refined.
    pub refined: u64,
    /// Accepted with a wider covariance because of little support.
    pub weak: u64,
    /// Predicted from the motions before, because nothing matched.
    pub predicted: u64,
    /// Weak or predicted.
    pub doubtful: u64,
    /// Refined ones whose initial guess was not the prediction.
    pub second_hypothesis: u64,
}

impl MotionCounts {
    /// From the poses.
    pub fn of(poses: &[PoseHeader]) -> Self {
        let with = |outcome| {
            poses
                .iter()
                .map(|pose| pose.motion.refinement)
                .filter(move |r| r.outcome == outcome)
        };
        let count = |outcome| with(outcome).count() as u64;
        let second =
            with(outcome::REFINED).filter(|r| r.initial_guess != initial_guess::PREDICTION);
        let (weak, predicted) = (count(outcome::WEAK), count(outcome::PREDICTED));
        Self {
            refined: count(outcome::REFINED),
            weak,
            predicted,
            doubtful: weak + predicted,
            second_hypothesis: second.count() as u64,
        }
    }
}

impl Counts {
    /// From the poses and the end of the stream, if it came to that. `first` is the first scan played.
    pub fn of(poses: &[PoseHeader], end: Option<&PoseHeader>, first: usize) -> Self {
        let last = poses.last();
        let published = end
            .map(|end| end.item.published)
            .or(last.map(|last| last.item.published + 1))
            .unwrap_or(0);
        let seen = end
            .map(|end| end.item.scan)
            .or(last.map(|last| last.item.scan + 1))
            .map_or(0, |next| next.saturating_sub(first as u64));
        let processed = poses.len() as u64;
        let starts = poses
            .iter()
            .filter(|pose| pose.item.is(flag::BREAK))
            .count() as u64;
        Self {
            published,
            processed,
            dropped: end.or(last).map_or(0, |newest| newest.item.dropped()),
            unreadable: seen.saturating_sub(published),
            missing: missing(poses),
            breaks: starts.saturating_sub(1),
            motions: None,
        }
    }

    /// Returns whether the result is hardly one of the recording.
    pub fn too_many_are_unreadable(&self) -> bool {
        let read = self.published + self.unreadable;
        self.unreadable as f64 > MAX_UNREADABLE_SHARE * read as f64
    }
}

/// Number of scans that the recording lacks, by the intervals between those that it has.
fn missing(poses: &[PoseHeader]) -> u64 {
    let turns = |pose: &PoseHeader| {
        pose.item
            .scan
            .saturating_sub(pose.item.previous_scan)
            .max(1)
    };
    let motions = || poses.iter().filter(|pose| !pose.item.is(flag::BREAK));
    let mut periods: Vec<i64> = motions()
        .map(|pose| pose.motion.interval_ns / turns(pose) as i64)
        .collect();
    periods.sort_unstable();
    let Some(&period) = periods.get(periods.len() / 2).filter(|period| **period > 0) else {
        return 0;
    };
    let fit = |pose: &PoseHeader| (pose.motion.interval_ns as f64 / period as f64).round() as u64;
    motions()
        .map(|pose| fit(pose).saturating_sub(turns(pose)))
        .sum()
}

/// The network that makes the masks.
#[derive(Debug, Serialize)]
struct Mask {
    /// The model card.
    model: String,
    /// The SHA-256 of the network's file.
    sha256: String,
}

impl Mask {
    /// From a resolved configuration.
    fn of(masking: &MaskingConfig) -> Option<Self> {
        let (model, sha256) = (masking.model.as_ref()?, masking.sha256.as_ref()?);
        let mask = Self {
            model: model.display().to_string(),
            sha256: sha256.clone(),
        };
        (masking.kind == MaskKind::Learned).then_some(mask)
    }
}

/// The summary of a run: `summary.json`.
#[derive(Debug, Serialize)]
pub struct Summary {
    version: &'static str,
    machine: Machine,
    out: String,
    data: String,
    /// `None`: the run failed.
    ending: Option<Ending>,
    mode: Mode,
    rate: Rate,
    window: usize,
    /// `None`: no network makes the masks.
    #[serde(skip_serializing_if = "Option::is_none")]
    mask: Option<Mask>,
    scans_in_recording: usize,
    resumed_after: usize,
    #[serde(flatten)]
    counts: Counts,
    wall_s: f64,
    scans_per_s: f64,
    #[serde(skip_serializing_if = "Option::is_none")]
    shared_memory: Option<Footprint>,
    restarts: BTreeMap<String, usize>,
    recovery_ms: Vec<f64>,
    /// Counters of each stage since its last start.
    stages: BTreeMap<String, StageCounters>,
    latency: Latency,
    /// As `gyre evaluate --json` prints it.
    evaluation: Option<Judgement>,
}

impl Summary {
    /// The counts of scans.
    pub fn counts(&self) -> &Counts {
        &self.counts
    }

    /// Puts it together.
    pub fn new(
        configuration: &Configuration,
        out: &Path,
        session: &Session<'_>,
        counts: Counts,
        latency: Latency,
        evaluation: Option<Judgement>,
    ) -> Self {
        let (wall_s, report) = (session.wall.as_secs_f64(), session.report);
        Self {
            version: env!("CARGO_PKG_VERSION"),
            machine: Machine::this(),
            out: out.display().to_string(),
            data: configuration.data(),
            ending: session.ending,
            mode: configuration.run.mode,
            rate: configuration.run.rate,
            window: configuration.run.window,
            mask: Mask::of(&configuration.odometry.masking),
            scans_in_recording: session.scans,
            resumed_after: session.resumed,
            counts,
            wall_s,
            scans_per_s: latency.scans as f64 / wall_s.max(f64::MIN_POSITIVE),
            shared_memory: session.footprint.cloned(),
            restarts: report
                .map(|report| report.restarts.clone())
                .unwrap_or_default(),
            recovery_ms: report
                .into_iter()
                .flat_map(|r| &r.recovery)
                .map(|time| time.as_secs_f64() * 1e3)
                .collect(),
            stages: report
                .map(|report| report.counters.clone())
                .unwrap_or_default(),
            latency,
            evaluation,
        }
    }
}

impl fmt::Display for Summary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let c = &self.counts;
        let ending = match self.ending {
            Some(Ending::Complete) if c.unreadable > 0 => "complete but for unreadable scans",
            Some(Ending::Complete) => "complete",
            Some(Ending::Interrupted) => "interrupted: the same command resumes from here",
            None => "failed",
        };
        writeln!(
            f,
            "\n{ending}: {} of {} scans in {:.1} s, {:.1} scans/s",
            c.processed, self.scans_in_recording, self.wall_s, self.scans_per_s
        )?;
        writeln!(
            f,
            "published {}  dropped {}  unreadable {}  missing {}  breaks {}",
            c.published, c.dropped, c.unreadable, c.missing, c.breaks
        )?;
        if let Some(m) = &c.motions {
            writeln!(
                f,
                "motions refined {} ({} by a second hypothesis)  weak {}  predicted {}",
                m.refined, m.second_hypothesis, m.weak, m.predicted
            )?;
        }
        if !self.restarts.is_empty() {
            let restarts: Vec<_> = self
                .restarts
                .iter()
                .map(|(stage, times)| format!("{stage} {times}"))
                .collect();
            let recovery: Vec<_> = self
                .recovery_ms
                .iter()
                .map(|ms| format!("{ms:.0}"))
                .collect();
            writeln!(
                f,
                "restarts {}  recovered after {} ms",
                restarts.join(", "),
                recovery.join(", ")
            )?;
        }
        self.latency_table(f)?;
        if let Some(evaluation) = &self.evaluation {
            writeln!(f, "\n{evaluation}")?;
        }
        write!(
            f,
            "\nresults in {}: odometry.csv, trajectory.tum, trajectory.svg, latency.json, summary.json",
            self.out
        )
    }
}

impl Summary {
    fn latency_table(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "\n{:22}{:>10}{:>10}{:>10}{:>10}   busy   allocations",
            "latency, us", "p50", "p90", "p99", "max"
        )?;
        row(f, "sensor to pose", &self.latency.sensor_to_pose)?;
        writeln!(f)?;
        for stage in StageId::ALL {
            let Some(hop) = self.latency.stages.get(stage.name()) else {
                continue;
            };
            if let Some(transport) = &hop.transport {
                row(f, "  transport", transport)?;
                writeln!(f)?;
            }
            row(f, stage.name(), &hop.work)?;
            write!(f, "{:6.0} %", hop.busy * 100.0)?;
            let counters = self.stages.get(stage.name());
            match counters.and_then(|counters| counters.allocations_after_five) {
                Some(allocations) => writeln!(f, "{allocations:14}")?,
                None => writeln!(f)?,
            }
        }
        let bound_by = self.latency.bound_by.unwrap_or("nothing");
        write!(
            f,
            "bounded by {bound_by}; two or more stages busy at once {:.0} % of the time",
            self.latency.overlap * 100.0
        )?;
        writeln!(f, "; allocations: in `process` after its first five items")
    }
}

fn row(f: &mut fmt::Formatter<'_>, name: &str, p: &Percentiles) -> fmt::Result {
    write!(
        f,
        "{name:22}{:10.0}{:10.0}{:10.0}{:10.0}",
        p.p50_us, p.p90_us, p.p99_us, p.max_us
    )
}

#[cfg(test)]
mod tests {
    use gyre_messages::{Item, MotionEstimate, RefinementRecord};

    use super::*;

    #[test]
    fn every_scan_is_accounted_for() {
        let pose = |seq, published, scan| PoseHeader {
            item: Item {
                seq,
                published,
                scan,
                ..Item::default()
            },
            ..PoseHeader::default()
        };
        let end = pose(3, 9, 15);
        let poses = [pose(0, 0, 5), pose(1, 3, 8), pose(2, 7, 13)];
        let counts = Counts::of(&poses, Some(&end), 5);
        assert_eq!(
            counts,
            Counts {
                published: 9,
                processed: 3,
                dropped: 6,
                unreadable: 1,
                ..Counts::default()
            }
        );
    }

    #[test]
    fn weak_and_predicted_motions_are_doubtful() {
        let pose = |(outcome, initial_guess)| {
            let refinement = RefinementRecord {
                outcome,
                initial_guess,
                ..RefinementRecord::default()
            };
            PoseHeader {
                motion: MotionEstimate {
                    refinement,
                    ..MotionEstimate::default()
                },
                ..PoseHeader::default()
            }
        };
        let poses = [
            (outcome::SEARCHED, initial_guess::NONE),
            (outcome::REFINED, initial_guess::PREDICTION),
            (outcome::REFINED, initial_guess::SEARCH),
            (outcome::REFINED, initial_guess::YAW_OFFSET),
            (outcome::WEAK, initial_guess::SEARCH),
            (outcome::PREDICTED, initial_guess::NONE),
        ];
        let counts = MotionCounts::of(&poses.map(pose));
        let expected = MotionCounts {
            refined: 3,
            weak: 1,
            predicted: 1,
            doubtful: 2,
            second_hypothesis: 2,
        };
        assert_eq!(counts, expected);
    }

    #[test]
    fn scans_that_the_recording_lacks_show_in_its_times_and_skipped_ones_do_not_count() {
        let pose = |scan, previous_scan, interval_ms: i64| PoseHeader {
            item: Item {
                scan,
                previous_scan,
                flags: if scan == 0 { flag::BREAK } else { 0 },
                ..Item::default()
            },
            motion: MotionEstimate {
                interval_ns: interval_ms * 1_000_000,
                ..MotionEstimate::default()
            },
            ..PoseHeader::default()
        };
        let mut poses = vec![
            pose(0, 0, 0),
            pose(1, 0, 251),
            pose(2, 1, 249),
            pose(4, 2, 500),
            pose(5, 4, 250),
        ];
        assert_eq!(missing(&poses), 0);
        poses.extend([pose(6, 5, 500), pose(8, 6, 1_000)]);
        assert_eq!(missing(&poses), 1 + 2);
        assert_eq!(missing(&poses[..1]), 0);
    }
}
