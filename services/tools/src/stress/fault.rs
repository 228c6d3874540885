//! The faults of the stages of a run while it is measured.

use std::time::Duration;

use gyre_client::clock;
use gyre_contract::{PoseHeader, StageId};
use rand::{Rng, SeedableRng, seq::SliceRandom};
use rand_chacha::ChaCha8Rng;
use rustix::process::{Pid, Signal, kill_process_group};
use serde::Serialize;

use crate::stress::processes::Sampler;

/// Time for which a stage is stopped.
const STOP: Duration = Duration::from_secs(1);
/// The shortest time between two faults. A stage may be restarted only so often.
const SHORTEST: Duration = Duration::from_secs(3);
/// The largest deviation from even times: more than the period of a radar.
const JITTER: Duration = Duration::from_millis(300);
/// Faults in the time that is measured, if it is long enough.
const FAULTS: u32 = 10;
/// Time that is left after the last fault.
const RECOVERY: Duration = Duration::from_secs(2);

/// Time between two polls for a stage whose process is not there.
const RETRY_PERIOD: Duration = Duration::from_millis(200);

/// The shortest measurement that has time for a fault.
pub const LEAST: Duration = Duration::from_secs(5);

#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum FaultKind {
    /// SIGSTOP, and SIGCONT after a second.
    Stop,
    /// SIGKILL.
    Kill,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Fault {
    pub kind: FaultKind,
    pub stage: &'static str,
    /// The start of the fault, s since the measurement began.
    pub at_s: f64,
    /// Time from the kill, or from the end of the stop, to the first pose that the stage has worked
    /// on since, ms; `None`: there was no such pose.
    pub recovery_ms: Option<f64>,
    /// The stage, and the end of its fault, `CLOCK_MONOTONIC`, ns; `None` while it is stopped.
    #[serde(skip)]
    pub ended: Option<(StageId, i64)>,
}

/// The seed of the order of the stages.
const SEED: u64 = 0;

/// Faults one after the other. The stages have a random order, and each stage has its turn.
#[derive(Debug)]
pub struct Faults {
    kind: FaultKind,
    stages: Vec<StageId>,
    random: ChaCha8Rng,
    queue: Vec<StageId>,
    /// The begin and the end of the measurement, `CLOCK_MONOTONIC`, ns.
    began_ns: i64,
    ends_ns: i64,
    next_ns: i64,
    every_ns: i64,
    /// The stage whose turn it is and whose process was not found.
    sought: Option<StageId>,
    /// The process group of the last fault while it is stopped, and the time for continuing it.
    stopped: Option<(Pid, StageId, i64)>,
    done: Vec<Fault>,
}

impl Faults {
    /// Faults of these stages in `duration` from `began_ns` on.
    pub fn new(
        (kind, stages): (FaultKind, Vec<StageId>),
        began_ns: i64,
        duration: Duration,
    ) -> Self {
        let every = (duration / FAULTS).max(SHORTEST);
        let (every_ns, duration_ns) = (nanoseconds(every), nanoseconds(duration));
        Self {
            kind,
            stages,
            random: ChaCha8Rng::seed_from_u64(SEED),
            queue: Vec::new(),
            began_ns,
            ends_ns: began_ns + duration_ns,
            next_ns: began_ns + every_ns / 2,
            every_ns,
            sought: None,
            stopped: None,
            done: Vec::new(),
        }
    }

    pub fn act(&mut self, processes: &Sampler) {
        let now_ns = clock::now_ns();
        let stopped = self.stopped.take_if(|(.., until_ns)| now_ns >= *until_ns);
        if let (Some((group, stage, _)), Some(fault)) = (stopped, self.done.last_mut()) {
            // That it has been killed meanwhile is no error.
            let _ = kill_process_group(group, Signal::CONT);
            fault.ended = Some((stage, clock::now_ns()));
        }
        let has_time = now_ns + nanoseconds(STOP + RECOVERY) < self.ends_ns;
        if now_ns < self.next_ns || self.stopped.is_some() || !has_time {
            return;
        }
        let Some(stage) = self.sought.take().or_else(|| self.next_stage()) else {
            return;
        };
        if !self.strike(stage, processes.group_of(stage.name())) {
            // It may be just being restarted.
            self.sought = Some(stage);
            self.next_ns = now_ns + nanoseconds(RETRY_PERIOD);
            return;
        }
        // Not always at the same time before the next scan.
        let jitter_ns = nanoseconds(JITTER);
        self.next_ns += self.every_ns + self.random.random_range(-jitter_ns..jitter_ns);
    }

    fn next_stage(&mut self) -> Option<StageId> {
        if self.queue.is_empty() {
            self.queue.clone_from(&self.stages);
            self.queue.shuffle(&mut self.random);
        }
        self.queue.pop()
    }

    /// Stops or kills a process group; false if it is not there.
    fn strike(&mut self, stage: StageId, group: Option<u32>) -> bool {
        let signal = match self.kind {
            FaultKind::Kill => Signal::KILL,
            FaultKind::Stop => Signal::STOP,
        };
        let group = group.and_then(|group| Pid::from_raw(group as i32));
        let now_ns = clock::now_ns();
        let Some(group) = group.filter(|group| kill_process_group(*group, signal).is_ok()) else {
            return false;
        };
        let is_stop = self.kind == FaultKind::Stop;
        self.done.push(Fault {
            kind: self.kind,
            stage: stage.name(),
            at_s: (now_ns - self.began_ns) as f64 * 1e-9,
            recovery_ms: None,
            ended: (!is_stop).then_some((stage, now_ns)),
        });
        self.stopped = is_stop.then(|| (group, stage, now_ns + nanoseconds(STOP)));
        true
    }

    /// Returns the reason why the measurement lacks faults of some stages.
    fn omitted(&self) -> Option<String> {
        let sought = self.sought.map(StageId::name);
        let not_found = sought
            .map(|name| format!("the process of {name} was not found, so nothing was done to it"));
        let nothing = || "nothing was done to any stage: raise --duration".to_owned();
        not_found.or_else(|| self.done.is_empty().then(nothing))
    }

    /// Notes which faults the run has recovered from with this pose.
    pub fn pose(&mut self, pose: &PoseHeader) {
        let hops = &pose.item.hops;
        let posed_ns = hops[StageId::PoseIntegration as usize].published_ns;
        let open = self.done.iter_mut().filter(|it| it.recovery_ms.is_none());
        for fault in open {
            let has_worked =
                |(stage, ended_ns): &(StageId, i64)| hops[*stage as usize].started_ns > *ended_ns;
            let ended = fault.ended.filter(has_worked);
            fault.recovery_ms = ended.map(|(_, ended_ns)| (posed_ns - ended_ns) as f64 * 1e-6);
        }
    }

    pub fn are_open(&self) -> bool {
        self.done.iter().any(|fault| fault.recovery_ms.is_none())
    }

    /// Returns all faults, and the reason why some are missing. A stopped stage is continued first.
    pub fn finish(mut self) -> (Vec<Fault>, Option<String>) {
        let omitted = self.omitted();
        (std::mem::take(&mut self.done), omitted)
    }
}

impl Drop for Faults {
    fn drop(&mut self) {
        if let Some((group, ..)) = self.stopped.take() {
            let _ = kill_process_group(group, Signal::CONT);
        }
    }
}

fn nanoseconds(duration: Duration) -> i64 {
    duration.as_nanos() as i64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn faults(kind: FaultKind) -> Faults {
        let stages = vec![StageId::Masking, StageId::Refinement];
        Faults::new((kind, stages), 0, Duration::from_secs(60))
    }

    #[test]
    fn each_stage_has_its_turn() {
        let mut faults = faults(FaultKind::Kill);
        for _ in 0..5 {
            let mut turn = [faults.next_stage(), faults.next_stage()];
            turn.sort_unstable();
            assert_eq!(turn, [Some(StageId::Masking), Some(StageId::Refinement)]);
        }
    }

    #[test]
    fn a_stage_that_was_not_found_and_a_time_without_any_fault_are_named() {
        let mut faults = faults(FaultKind::Kill);
        let nothing = faults.omitted().unwrap_or_default();
        assert!(nothing.contains("raise --duration"), "{nothing}");
        assert!(!faults.strike(StageId::Masking, None));
        faults.sought = Some(StageId::Masking);
        let not_found = faults.omitted().unwrap_or_default();
        assert!(not_found.contains("masking was not found"), "{not_found}");
        // The shortest measurement has time for a fault.
        let begun = Faults::new((FaultKind::Stop, vec![StageId::Masking]), 0, LEAST);
        assert!(begun.next_ns + nanoseconds(STOP + RECOVERY) < begun.ends_ns);
    }

    #[test]
    fn a_fault_is_over_with_a_pose_that_the_stage_has_worked_on_since() {
        let mut faults = faults(FaultKind::Kill);
        faults.done.push(Fault {
            kind: FaultKind::Kill,
            stage: StageId::Masking.name(),
            at_s: 1.0,
            recovery_ms: None,
            ended: Some((StageId::Masking, 1_000_000_000)),
        });
        let mut pose = PoseHeader::default();
        let pose_at = |pose: &mut PoseHeader, started_ns: i64| {
            pose.item.hop_mut(StageId::Masking).started_ns = started_ns;
            pose.item.hop_mut(StageId::PoseIntegration).published_ns = started_ns + 5_000_000;
        };
        pose_at(&mut pose, 999_000_000);
        faults.pose(&pose);
        assert!(faults.are_open());
        pose_at(&mut pose, 1_040_000_000);
        faults.pose(&pose);
        assert!(!faults.are_open());
        assert_eq!(faults.finish().0[0].recovery_ms, Some(45.0));
    }
}
