//! What is done after a death: which processes are started again, and when that has helped.

use std::time::{Duration, Instant};

use gyre_messages::{Header, PoseHeader, StageId};
use gyre_stage::{clock, wake};

use crate::{
    Event, SuperviseError, Supervisor,
    child::{Child, Death},
    clean,
    start::Starter,
};

/// A restarted stage without a pose that the new process has worked on.
pub(crate) struct Recovering {
    hop: StageId,
    died_ns: i64,
    started_ns: i64,
}

impl Supervisor<'_> {
    /// Restarts dead stages, or all stages if that alone would not help.
    pub(crate) fn recover(&mut self, dead: &[usize]) -> Result<(), SuperviseError> {
        let died_ns = clock::now_ns();
        let failure = self.may_restart(dead)?;
        let blamed = failure.map_or_else(Vec::new, |failure| self.blame_trial(dead, &failure));
        let stages = [dead, &blamed].concat();
        let all = stages.iter().any(|i| {
            let child = &self.children[*i];
            child.died_without_progress(self.newest_seq()) || child.plan().restarts_all
        });
        match all {
            true => self.restart(&self.all_but_survivors(&stages), died_ns),
            false => self.restart(&stages, died_ns),
        }
    }

    /// Goes back to the programs before those that are on trial while another stage fails: what they sent may be the cause. Returns them.
    fn blame_trial(&mut self, dead: &[usize], failure: &str) -> Vec<usize> {
        let is_blamed = |i: &usize| self.children[*i].is_on_trial() && !dead.contains(i);
        let mut blamed: Vec<usize> = self.all().filter(is_blamed).collect();
        blamed.retain(|i| self.go_back(*i, failure));
        blamed
    }

    /// Counts deaths against the restart policies, and waits for the longest backoff. Returns a sentence about one that was a failure of a
    /// program which is not on trial.
    pub(crate) fn may_restart(&mut self, dead: &[usize]) -> Result<Option<String>, SuperviseError> {
        let (mut backoff, mut failure) = (Duration::ZERO, None);
        for i in dead {
            let child = &mut self.children[*i];
            let death = child.death();
            (self.observe)(Event::Died {
                stage: child.name(),
                death: &death,
            });
            if !death.killed {
                backoff = backoff.max(child.backoff());
                if !child.is_on_trial() {
                    failure = Some(format!("{} died after it: {death}", child.name()));
                }
            }
            self.require_restart(*i, &death)?;
            self.count_restart(*i);
        }
        self.pause(backoff)?;
        Ok(failure)
    }

    /// Lets time pass. A request to stop, or a process that dies meanwhile, is found afterwards.
    fn pause(&mut self, time: Duration) -> Result<(), SuperviseError> {
        let end = Instant::now() + time;
        while let Some(rest) = end.checked_duration_since(Instant::now()) {
            if self.signals.wait(&[], None, rest.min(wake::MAX_WAIT))?.stop {
                break;
            }
            (self.observe)(Event::Watched);
        }
        Ok(())
    }

    /// Returns whether a dead process may be started again, by its policy. One that has taken the place of another gives way to it
    /// first.
    pub(crate) fn require_restart(
        &mut self,
        child: usize,
        death: &Death,
    ) -> Result<(), SuperviseError> {
        if self.children[child].is_on_trial() && self.go_back(child, &death.to_string()) {
            return Ok(());
        }
        match self.children[child].may_restart(death) {
            Err(error) if self.go_back(child, &error.to_string()) => Ok(()),
            may_restart => may_restart,
        }
    }

    pub(crate) fn count_restart(&mut self, child: usize) {
        let name = self.children[child].name().to_owned();
        *self.restarts.entry(name).or_default() += 1;
    }

    pub(crate) fn newest_seq(&self) -> Option<u64> {
        self.newest.map(|newest| newest.seq)
    }

    pub(crate) fn poses_so_far(&self) -> u64 {
        self.newest_seq().map_or(0, |newest| newest + 1)
    }

    /// Returns the processes to restart with one of them: itself, or all stages if its restart alone does not recover its state.
    pub(crate) fn restarted_with(&self, child: usize) -> Vec<usize> {
        match self.children[child].plan().restarts_all {
            true => self.all_but_survivors(&[child]),
            false => vec![child],
        }
    }

    /// Returns all stages.
    pub(crate) fn all(&self) -> impl Iterator<Item = usize> + '_ {
        (0..self.children.len()).filter(|i| !self.children[*i].follows())
    }

    /// Returns all stages except those that are alive and outlive restarts.
    pub(crate) fn all_but_survivors(&self, dead: &[usize]) -> Vec<usize> {
        let survives = |i: &usize| self.children[*i].plan().outlives_restarts && !dead.contains(i);
        self.all().filter(|i| !survives(i)).collect()
    }

    pub(crate) fn restart(&mut self, stages: &[usize], died_ns: i64) -> Result<(), SuperviseError> {
        self.replace(stages, died_ns, None)?;
        self.watchdog.restarted();
        self.say_restarted(stages);
        Ok(())
    }

    pub(crate) fn say_restarted(&mut self, processes: &[usize]) {
        let only = match processes {
            [child] => Some(self.children[*child].name()),
            _ => None,
        };
        (self.observe)(Event::Restarted { only });
    }

    /// Ends processes and starts others in their places; in one of them a process that stood by goes on.
    pub(crate) fn replace(
        &mut self,
        stages: &[usize],
        died_ns: i64,
        mut successor: Option<(usize, Child)>,
    ) -> Result<(), SuperviseError> {
        stages.iter().for_each(|i| self.children[*i].kill());
        for i in stages {
            self.children[*i].await_end()?;
            self.guardian.forget(self.children[*i].pid());
        }
        let all_dead = stages.len() == self.children.len() && successor.is_none();
        clean::remove_dead(&self.plan.manifest, &self.transport, all_dead)?;
        let newest = self.newest_seq();
        for i in stages {
            match successor.take_if(|(place, _)| place == i) {
                Some((_, successor)) => self.children[*i].succeed(successor, newest),
                None => self.respawn(*i)?,
            }
            let stage = self.children[*i].stage();
            self.recovering.extend(stage.map(|hop| Recovering {
                hop,
                died_ns,
                started_ns: clock::now_ns(),
            }));
        }
        Ok(())
    }

    /// Starts a process again. If its program cannot be started, and has taken the place of another one, that one is.
    fn respawn(&mut self, child: usize) -> Result<(), SuperviseError> {
        let newest = self.newest_seq();
        loop {
            let starter = Starter::new(&self.signals, &self.guardian);
            let respawned = self.children[child].respawn(&self.plan.manifest, &starter, newest);
            match respawned {
                Err(error) if error.is_of_one_process() => {
                    let reason = error.to_string();
                    if !self.go_back(child, &reason) {
                        return Err(error);
                    }
                    self.children[child].note_death(reason);
                }
                respawned => return respawned,
            }
        }
    }

    /// Returns why one of these processes could not be started again, as far as that is known. Then it must not be ended.
    pub(crate) fn why_not_again(
        &self,
        mut processes: impl Iterator<Item = usize>,
    ) -> Option<String> {
        processes.find_map(|i| {
            let child = &self.children[i];
            let (name, path) = (child.name(), child.changed_file()?.display());
            Some(format!(
                "{name} could not be started again, since {path} has changed; `gyre swap {name}` takes the new one"
            ))
        })
    }
}

/// Records the recovery of stages at the first pose that their new processes worked on; items in flight do not count.
pub(crate) fn record_recoveries(
    pose: &PoseHeader,
    recovering: &mut Vec<Recovering>,
    recovery: &mut Vec<Duration>,
) {
    let hops = pose.item().hops;
    recovering.retain(|stage| {
        let recovered = hops[stage.hop as usize].started_ns > stage.started_ns;
        if recovered {
            recovery.push(Duration::from_nanos(
                (clock::now_ns() - stage.died_ns).max(0) as u64,
            ));
        }
        !recovered
    });
}

/// A program that has worked on a pose since it took the place of another one has passed its trial.
pub(crate) fn pass_trials(pose: &PoseHeader, children: &mut [Child], recovering: &[Recovering]) {
    for child in children.iter_mut().filter(|child| child.is_on_trial()) {
        let Some(hop) = child.stage() else {
            // No pose says what a follower has done.
            if child.has_outlived_its_window() {
                child.pass_trial();
            }
            continue;
        };
        let started = recovering.iter().rev().find(|stage| stage.hop == hop);
        let has_worked =
            |stage: &Recovering| pose.item().hops[hop as usize].started_ns > stage.started_ns;
        if started.is_none_or(has_worked) {
            child.pass_trial();
        }
    }
}
