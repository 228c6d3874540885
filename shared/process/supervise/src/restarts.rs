//! Restarts: the actions after a death or a stall, as the parts of the supervisor have decided.

use std::time::{Duration, Instant};

use gyre_transport::clock;

use crate::{
    Event, Stall, SuperviseError,
    child::{Child, Death, RESTART_BACKOFF},
    clean,
    followers::Patience,
    recovery::restarted_after,
    supervisor::Supervisor,
};

impl Supervisor<'_> {
    /// Restarts dead stages, or all stages if that alone would not help.
    pub(crate) fn recover(&mut self, dead: &[usize]) -> Result<(), SuperviseError> {
        let died_ns = clock::now_ns();
        let failure = self.count_deaths(dead)?;
        let blamed = failure.map_or_else(Vec::new, |failure| self.blame_trial(dead, &failure));
        let newest = self.poses.newest_seq();
        let died_without_progress = |i: usize| self.processes[i].died_without_progress(newest);
        let stages = [dead, &blamed].concat();
        let restarted = restarted_after(&stages, self.run.plan, died_without_progress);
        self.restart(&restarted, died_ns)
    }

    /// Goes back from programs on trial, whose messages may be why another stage fails; returns
    /// these processes.
    fn blame_trial(&mut self, dead: &[usize], failure: &str) -> Vec<usize> {
        let is_blamed = |i: &usize| self.processes[*i].is_on_trial && !dead.contains(i);
        let mut blamed: Vec<usize> = self.run.plan.in_stream().filter(is_blamed).collect();
        blamed.retain(|i| self.go_back(*i, failure));
        blamed
    }

    /// Counts deaths against the restart policies, and waits for the longest backoff. Returns a
    /// sentence about one that was a failure of a program which is not on trial.
    fn count_deaths(&mut self, dead: &[usize]) -> Result<Option<String>, SuperviseError> {
        let (mut backoff, mut failure) = (Duration::ZERO, None);
        for i in dead {
            let child = &mut self.processes[*i];
            let death = child.death();
            let (name, output) = (child.name(), death.output());
            self.run
                .note(&format!("{name} died by {}{output}", death.cause));
            if death.code.is_some() {
                backoff = backoff.max(RESTART_BACKOFF);
                if !child.is_on_trial {
                    failure = Some(format!("{name} died after it: {death}"));
                }
            }
            self.require_restart(*i, &death)?;
            self.processes.count_restart(*i);
        }
        self.run.pause(backoff)?;
        Ok(failure)
    }

    /// A program that has taken the place of another gives way to it first.
    fn require_restart(&mut self, process: usize, death: &Death) -> Result<(), SuperviseError> {
        if self.processes[process].is_on_trial && self.go_back(process, &death.to_string()) {
            return Ok(());
        }
        match self.processes[process].may_restart(death) {
            Err(error) if self.go_back(process, &error.to_string()) => Ok(()),
            may_restart => may_restart,
        }
    }

    /// Returns to the program before a swap, from the next start on; false without such a program.
    fn go_back(&mut self, process: usize, reason: &str) -> bool {
        let begun = &self.run.plan.stages[process];
        let child = &mut self.processes[process];
        let failed = child.plan.command.join(" ");
        if !child.go_back(begun) {
            return false;
        }
        let name = child.name();
        self.swaps.fail_trial(process, name, &failed, reason);
        self.swaps.has_swapped(&child.plan, self.poses.count());
        let sentence = format!("{name} goes back to the program before: {reason}");
        self.run.note(&sentence);
        true
    }

    pub(crate) fn restart(
        &mut self,
        processes: &[usize],
        died_ns: i64,
    ) -> Result<(), SuperviseError> {
        self.replace(processes, died_ns, None)?;
        self.stalls.restarted();
        self.say_restarted(processes);
        Ok(())
    }

    fn say_restarted(&mut self, processes: &[usize]) {
        match processes {
            [process] => {
                let name = self.processes[*process].name();
                self.run.note(&format!("restarted {name}"));
            }
            // All stages, or all but a live source.
            _ => self.run.note("restarted the stages from the journal"),
        }
    }

    /// One of the replacements may be the process on standby.
    pub(crate) fn replace(
        &mut self,
        processes: &[usize],
        died_ns: i64,
        mut successor: Option<(usize, Child)>,
    ) -> Result<(), SuperviseError> {
        self.processes.kill(processes, &self.run.guardian)?;
        let all_dead = processes.len() == self.processes.len() && successor.is_none();
        let (manifest, transport) = (self.run.manifest(), &self.run.transport);
        clean::remove_dead(manifest, transport, all_dead)?;
        for i in processes {
            match successor.take_if(|(place, _)| place == i) {
                Some((_, successor)) => {
                    let newest = self.poses.newest_seq();
                    self.processes[*i].succeed(successor, newest);
                }
                None => self.respawn(*i)?,
            }
            if let Some(hop) = self.processes[*i].stage() {
                self.recovery.begins(hop, died_ns);
            }
        }
        Ok(())
    }

    /// If its program cannot be started and had replaced another, that one is started.
    fn respawn(&mut self, process: usize) -> Result<(), SuperviseError> {
        let newest = self.poses.newest_seq();
        loop {
            let starter = self.run.starter();
            match self.processes[process].respawn(&starter, newest) {
                Err(SuperviseError::Process(reason)) => {
                    if !self.go_back(process, &reason) {
                        return Err(SuperviseError::Process(reason));
                    }
                    self.processes[process].start_error = Some(reason);
                }
                respawned => return respawned,
            }
        }
    }

    pub(crate) fn look_for_stalls(&mut self) -> Result<(), SuperviseError> {
        let (processes, run) = (&self.processes, &self.run);
        let starting = processes.starting(run);
        let starting = starting.map(|child| (child.name(), child.started));
        let hangs = |process, since| processes.hangs(process, since, run);
        let found = self.stalls.look(Instant::now(), hangs, starting);
        for (follower, hang) in found.followers {
            // It counts as a death.
            self.run.say(Event::Stalled(&hang));
            self.processes[follower].kill();
        }
        found
            .stall
            .map_or(Ok(()), |stall| self.recover_from_stall(stall))
    }

    fn recover_from_stall(&mut self, stall: Stall) -> Result<(), SuperviseError> {
        let Some(processes) = self.stalls.remedy(&stall) else {
            return Err(SuperviseError::Stalled(stall));
        };
        self.run.say(Event::Stalled(&stall));
        for i in &processes {
            self.processes.count_restart(*i);
            if self.processes[*i].is_on_trial {
                self.go_back(*i, &stall.to_string());
            }
        }
        self.restart(&processes, clock::now_ns())
    }

    /// The stages do not notice, and one that cannot be restarted does not end them.
    pub(crate) fn recover_followers(&mut self, dead: &[usize]) -> Result<(), SuperviseError> {
        let mut dead = dead.to_vec();
        dead.retain(|i| self.followers.is_behind(*i));
        for follower in dead {
            match self.recover_follower(follower) {
                Err(SuperviseError::Process(reason)) => {
                    let name = self.processes[follower].name();
                    self.run
                        .note(&format!("{reason}: odometry continues without {name}"));
                    self.followers.given_up.push((follower, reason));
                }
                recovered => recovered?,
            }
        }
        Ok(())
    }

    fn recover_follower(&mut self, dead: usize) -> Result<(), SuperviseError> {
        let died_ns = clock::now_ns();
        self.count_deaths(&[dead])?;
        self.replace(&[dead], died_ns, None)?;
        self.say_restarted(&[dead]);
        Ok(())
    }

    /// A follower that has stayed for too long is started again as after a death.
    pub(crate) fn end_stuck_follower(&mut self, follower: usize) -> Result<(), SuperviseError> {
        let child = &mut self.processes[follower];
        let (progress, _) = self.followers.progress_of(follower);
        self.run.say(Event::Following {
            follower: child.name(),
            progress,
        });
        match self.followers.judge(follower, progress, child.started) {
            Patience::Wait => Ok(()),
            Patience::GiveUp(stall) => Err(SuperviseError::Stalled(stall)),
            Patience::End(stall) => {
                self.run.say(Event::Stalled(&stall));
                child.kill();
                child.await_end()
            }
        }
    }
}
