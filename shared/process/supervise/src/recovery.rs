//! Recovery after deaths: which processes are started again, and when that has helped.

use std::time::Duration;

use gyre_contract::{PoseHeader, StageId};
use gyre_transport::clock;

use crate::Plan;

#[derive(Default)]
pub(crate) struct Recovery {
    /// Restarted stages, until the first pose that the new process has worked on.
    recovering: Vec<Recovering>,
    /// The time from each death to the first pose with work of the new process.
    pub times: Vec<Duration>,
}

struct Recovering {
    hop: StageId,
    died_ns: i64,
    started_ns: i64,
}

impl Recovering {
    fn has_worked(&self, pose: &PoseHeader) -> bool {
        pose.item.hops[self.hop as usize].started_ns > self.started_ns
    }
}

impl Recovery {
    pub fn begins(&mut self, hop: StageId, died_ns: i64) {
        self.recovering.push(Recovering {
            hop,
            died_ns,
            started_ns: clock::now_ns(),
        });
    }

    pub fn has_worked(&self, hop: StageId, pose: &PoseHeader) -> bool {
        let started = self.recovering.iter().rev().find(|stage| stage.hop == hop);
        started.is_none_or(|stage| stage.has_worked(pose))
    }

    /// Ends the recovery of stages at the first pose that their new processes worked on; items in
    /// flight do not count.
    pub fn see(&mut self, pose: &PoseHeader) {
        let recovered = self
            .recovering
            .extract_if(.., |stage| stage.has_worked(pose));
        self.times
            .extend(recovered.map(|stage| {
                Duration::from_nanos((clock::now_ns() - stage.died_ns).max(0) as u64)
            }));
    }
}

/// Returns the processes to restart after these have died, or are to be replaced: all stages if a
/// restart of one alone does not recover its state, or has not helped before.
pub(crate) fn restarted_after(
    dead: &[usize],
    plan: &Plan,
    died_without_progress: impl Fn(usize) -> bool,
) -> Vec<usize> {
    let needs_all = |i: &usize| died_without_progress(*i) || plan.restarts_all(*i);
    match dead.iter().any(needs_all) {
        true => plan.all_but_survivors(dead),
        false => dead.to_vec(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::tests::{MASKING, REFINEMENT, SOURCE, plan};

    #[test]
    fn a_dead_stage_is_restarted_alone_unless_that_has_not_helped() {
        let mut plan = plan();
        let after =
            |plan: &_, dead: &[usize], is_stuck: bool| restarted_after(dead, plan, |_| is_stuck);
        assert_eq!(after(&plan, &[MASKING], false), [MASKING]);
        let all = [SOURCE, MASKING, REFINEMENT];
        assert_eq!(after(&plan, &[MASKING], true), all);
        plan.stages[REFINEMENT].restarts_all = true;
        assert_eq!(after(&plan, &[MASKING, REFINEMENT], false), all);
        plan.stages[SOURCE].outlives_restarts = true;
        assert_eq!(after(&plan, &[MASKING], true), [MASKING, REFINEMENT]);
    }

    #[test]
    fn a_stage_has_recovered_at_the_first_pose_of_its_new_process() {
        let mut recovery = Recovery::default();
        let mut pose = PoseHeader::default();
        assert!(
            recovery.has_worked(StageId::Masking, &pose),
            "not restarted"
        );
        pose.item.hop_mut(StageId::Masking).started_ns = clock::now_ns();
        recovery.begins(StageId::Masking, clock::now_ns() - 7_000_000_000);
        recovery.see(&pose);
        assert!(!recovery.has_worked(StageId::Masking, &pose), "in flight");
        pose.item.hop_mut(StageId::Masking).started_ns = clock::now_ns() + 1;
        assert!(recovery.has_worked(StageId::Masking, &pose));
        recovery.see(&pose);
        recovery.see(&pose);
        let times = recovery.times;
        assert_eq!(times.len(), 1);
        assert!(times[0] >= Duration::from_secs(7));
    }
}
