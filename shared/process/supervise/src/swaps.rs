//! Swaps: a new program replaces a stage's program during the run. It stands by and loads its data
//! while the one before works, and takes over when no scan is in flight, if there is such a moment:
//! the others see a restart. (Only masking in live mode knows which scans it has admitted.) A
//! program that fails before its first pose, or too often later, gives way to the one before.

mod trial;

use std::{
    fs,
    time::{Duration, Instant},
};

use gyre_contract::control::{Answer, PendingSwap, Swap};
use gyre_transport::run;

use crate::{
    StagePlan, SuperviseError, Swapped, child::Child, processes::Processes, program::Program,
    run::Run, socket::Client,
};
use trial::Trial;

/// Time for which a moment without a scan in flight is waited for. At the highest rate there is no
/// such moment.
const PATIENCE: Duration = Duration::from_secs(1);

pub(crate) const ENDED: &str = "the stream has ended";

#[derive(Default)]
pub(crate) struct Swaps {
    pub standby: Option<Standby>,
    /// Who waits for a program that has taken over to prove itself.
    trial: Option<Trial>,
    pub done: Vec<Swapped>,
}

pub(crate) struct Standby {
    /// The index of the process whose place it is to take.
    pub process: usize,
    pub child: Child,
    pub client: Client,
    since: Instant,
    ready: Option<Instant>,
}

impl Swaps {
    pub fn why_not_now(&self, has_ended: bool) -> Option<&'static str> {
        match () {
            () if has_ended => Some(ENDED),
            () if self.standby.is_some() || self.trial.is_some() => {
                Some("another program is taking over: wait until its first pose")
            }
            () => None,
        }
    }

    pub fn begin(
        &mut self,
        process: usize,
        plan: &StagePlan,
        client: Client,
        run: &Run<'_>,
    ) -> Result<(), SuperviseError> {
        let manifest = run.manifest();
        let _ = fs::remove_file(run::ready_file(&manifest.root, &plan.name));
        match Child::spawn(plan, &run.starter(), true) {
            Ok(child) => {
                self.standby = Some(Standby {
                    process,
                    child,
                    client,
                    since: Instant::now(),
                    ready: None,
                });
            }
            Err(SuperviseError::Process(reason)) => client.answer(&Answer::Refused(reason)),
            Err(error) => return Err(error),
        }
        Ok(())
    }

    /// Returns the program that is to take over now, or an error if it cannot; `None` as long as it
    /// stands by. `is_in_flight` returns whether a scan lacks its pose.
    pub fn step(
        &mut self,
        run: &Run<'_>,
        is_in_flight: impl FnOnce() -> bool,
    ) -> Option<(Standby, Result<(), String>)> {
        let mut standby = self.standby.take()?;
        let is_ready = run::ready_file(&run.manifest().root, standby.child.name()).exists();
        if is_ready && standby.ready.is_none() {
            standby.ready = Some(Instant::now());
        }
        let ready = standby.ready.map(|ready| ready.elapsed());
        let (stood_by, limit) = (standby.since.elapsed(), run.plan.start_timeout);
        let refused = standby.why_not().map(Err);
        match refused.or_else(|| judge(ready, stood_by, limit, is_in_flight)) {
            Some(judged) => Some((standby, judged)),
            None => {
                self.standby = Some(standby);
                None
            }
        }
    }

    pub fn pending(&self, processes: &Processes, run: &Run<'_>) -> Option<PendingSwap> {
        let (child, since, limit) = match (&self.standby, &self.trial) {
            (Some(standby), _) => (&standby.child, standby.since, run.plan.start_timeout),
            (None, Some(trial)) => (&processes[trial.process], trial.since, Some(trial::LIMIT)),
            (None, None) => return None,
        };
        Some(PendingSwap {
            process: child.plan.name.clone(),
            command: child.plan.command.clone(),
            has_taken_over: self.standby.is_none(),
            waited_s: since.elapsed().as_secs_f64(),
            limit_s: limit.map(|limit| limit.as_secs_f64()),
        })
    }

    pub fn has_swapped(&mut self, plan: &StagePlan, after_poses: u64) {
        self.done.push(Swapped {
            stage: plan.name.clone(),
            command: plan.command.clone(),
            after_poses,
        });
    }
}

impl Standby {
    fn why_not(&mut self) -> Option<String> {
        if self.child.has_exited() {
            let death = self.child.death();
            return Some(format!("it ended by {}{}", death.cause, death.output()));
        }
        let has_gone = self.client.has_gone();
        has_gone.then(|| "who has asked for it has gone".to_owned())
    }
}

/// Judges a program that has stood by for some time, and has been ready for some of it, if at all.
/// `None`: later.
fn judge(
    ready: Option<Duration>,
    stood_by: Duration,
    limit: Option<Duration>,
    is_in_flight: impl FnOnce() -> bool,
) -> Option<Result<(), String>> {
    match ready {
        None if limit.is_some_and(|limit| stood_by > limit) => Some(Err(
            "it did not get ready to take over (run.start_timeout_s); start a program that cannot stand by with --cold"
                .to_owned(),
        )),
        Some(ready) if !is_in_flight() || ready > PATIENCE => Some(Ok(())),
        _ => None,
    }
}

pub(crate) fn plan_of(begun: &StagePlan, swap: &Swap) -> StagePlan {
    match &swap.command {
        None => begun.clone(),
        Some(command) => StagePlan {
            command: command.clone(),
            programs: Program::all_of(command, Some(&swap.directory)),
            directory: Some(swap.directory.clone()),
            ..begun.clone()
        },
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_program_takes_over_when_it_is_ready_and_is_not_waited_for_without_end() {
        let (moment, long) = (Duration::from_millis(1), 2 * PATIENCE);
        for (ready, limit, is_in_flight, expected) in [
            (Some(moment), Some(moment), true, None),
            (Some(moment), Some(moment), false, Some(true)),
            (Some(long), Some(moment), true, Some(true)),
            (None, Some(moment), false, Some(false)),
            (None, Some(2 * long), false, None),
            (None, None, false, None),
        ] {
            let judged = judge(ready, long, limit, || is_in_flight);
            let judged = judged.map(|judged| judged.is_ok());
            assert_eq!(judged, expected, "{ready:?}, {limit:?}, {is_in_flight}");
        }
    }

    #[test]
    fn no_swap_begins_after_the_end_of_the_stream() {
        let swaps = Swaps::default();
        assert_eq!(swaps.why_not_now(true), Some(ENDED));
        assert_eq!(swaps.why_not_now(false), None);
    }
}
