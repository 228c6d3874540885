//! Swaps: another program takes the place of a stage while the run goes on.
//!
//! The new program first stands by: it loads what it needs while the one before works. It takes over when no scan is in flight, if
//! there is such a moment, and a restart of the stage is all that the others see. (Masking in live mode alone knows which scans it has
//! admitted: if there are some without a pose, the others are restarted with it.) A program that fails before its first pose, or too
//! often later, is given up, and the one before is started again.

use std::{
    fs,
    time::{Duration, Instant},
};

use gyre_stage::{
    clock,
    control::{Answer, Swap},
    run, schedule,
};

use crate::{
    Event, StagePlan, SuperviseError, Supervisor, Swapped,
    child::Child,
    program::Program,
    socket::Client,
    start::{Place, Starter},
};

/// Time for which a moment without a scan in flight is waited for. At the highest rate there is none.
const PATIENCE: Duration = Duration::from_secs(1);

const ENDED: &str = "the stream has ended";

/// A program that stands by.
pub(crate) struct Standby {
    /// The index of the process whose place it is to take.
    child: usize,
    process: Child,
    since: Instant,
    ready: Option<Instant>,
    client: Client,
}

impl Standby {
    pub fn pid(&self) -> u32 {
        self.process.pid()
    }
}

impl Supervisor<'_> {
    /// Starts a program that is to take the place of another one. The client has its answer when that has done so, and has worked on a
    /// first pose.
    pub(crate) fn begin_swap(&mut self, swap: Swap, client: Client) -> Result<(), SuperviseError> {
        let Some(child) = self.named(&swap.process) else {
            self.refuse_unknown(&swap.process, client);
            return Ok(());
        };
        let busy = match () {
            () if self.is_following => Some(ENDED),
            () if self.standby.is_some() || self.trial.is_some() => {
                Some("another program is taking over: wait until its first pose")
            }
            () => None,
        };
        if let Some(reason) = busy {
            client.answer(&Answer::Refused(reason.to_owned()));
            return Ok(());
        }
        let plan = self.plan_of(child, &swap);
        if swap.cold {
            return self.swap_cold(child, plan, client);
        }
        let manifest = &self.plan.manifest;
        let _ = fs::remove_file(run::ready_file(&manifest.root, &plan.name));
        let starter = Starter::new(&self.signals, &self.guardian);
        match Child::spawn(&plan, manifest, &starter, Place::Taken) {
            Ok(process) => {
                self.standby = Some(Standby {
                    child,
                    process,
                    since: Instant::now(),
                    ready: None,
                    client,
                });
            }
            Err(error) if error.is_of_one_process() => {
                client.answer(&Answer::Refused(error.to_string()));
            }
            Err(error) => return Err(error),
        }
        Ok(())
    }

    /// Ends a process, and starts another program in its place. If that cannot be started, the one before is started again.
    fn swap_cold(
        &mut self,
        child: usize,
        plan: StagePlan,
        client: Client,
    ) -> Result<(), SuperviseError> {
        let stages = self.restarted_with(child);
        if let Some(reason) = self.why_others_stay(child, &stages) {
            client.answer(&Answer::Refused(reason));
            return Ok(());
        }
        self.children[child].change(plan);
        self.restart_and_count(&stages)?;
        if self.children[child].is_on_trial() {
            self.has_swapped(child);
            self.await_trial(child, client);
            return Ok(());
        }
        let name = self.children[child].name();
        let reason = self.children[child].last_death().unwrap_or_default();
        client.answer(&Answer::Refused(format!(
            "{name} goes on as before: {reason}"
        )));
        Ok(())
    }

    /// Returns why the processes that are restarted together with `child` could not be.
    fn why_others_stay(&self, child: usize, stages: &[usize]) -> Option<String> {
        self.why_not_again(stages.iter().copied().filter(|i| *i != child))
    }

    /// Returns the plan of a process after a swap.
    fn plan_of(&self, child: usize, swap: &Swap) -> StagePlan {
        let begun = &self.plan.stages[child];
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

    /// Looks after the program that stands by, and lets it take over.
    pub(crate) fn continue_swap(&mut self) -> Result<(), SuperviseError> {
        let Some(mut standby) = self.standby.take() else {
            return Ok(());
        };
        let name = standby.process.name().to_owned();
        if standby.process.has_exited() {
            let death = standby.process.death();
            let output = death
                .last_output
                .map_or(String::new(), |line| format!(" ({line})"));
            return self.give_up(standby, format!("it ended by {}{output}", death.cause));
        }
        if standby.client.has_gone() {
            return self.give_up(standby, "who has asked for it has gone".to_owned());
        }
        let is_ready = run::ready_file(&self.plan.manifest.root, &name).exists();
        if is_ready && standby.ready.is_none() {
            standby.ready = Some(Instant::now());
        }
        let limit = self.plan.start_timeout;
        match standby.ready {
            None if limit.is_some_and(|limit| standby.since.elapsed() > limit) => self.give_up(
                standby,
                "it did not get ready to take over (run.start_timeout_s); start a program that cannot stand by with --cold"
                    .to_owned(),
            ),
            Some(since) if !self.has_scans_in_flight() || since.elapsed() > PATIENCE => {
                self.take_over(standby)
            }
            _ => {
                self.standby = Some(standby);
                Ok(())
            }
        }
    }

    /// Gives up the program that stands by, since the stream has ended.
    pub(crate) fn end_swap(&mut self) -> Result<(), SuperviseError> {
        match self.standby.take() {
            Some(standby) => self.give_up(standby, ENDED.to_owned()),
            None => Ok(()),
        }
    }

    fn give_up(&mut self, standby: Standby, reason: String) -> Result<(), SuperviseError> {
        let name = standby.process.name();
        let command = standby.process.plan().command.join(" ");
        let sentence =
            format!("{name} goes on as before, since `{command}` cannot take over: {reason}");
        standby.client.answer(&Answer::Refused(sentence));
        let pid = standby.process.pid();
        // Its end is waited for.
        drop(standby.process);
        self.guardian.forget(pid);
        Ok(())
    }

    /// Ends the program that is to be replaced, and lets the new one go on.
    fn take_over(&mut self, standby: Standby) -> Result<(), SuperviseError> {
        let stages = self.restarted_with(standby.child);
        if let Some(reason) = self.why_others_stay(standby.child, &stages) {
            return self.give_up(standby, reason);
        }
        let Standby {
            child,
            process,
            client,
            ..
        } = standby;
        let _ = fs::remove_file(run::ready_file(&self.plan.manifest.root, process.name()));
        let stages = match self.ends_between_scans(child)? {
            true => vec![child],
            false => stages,
        };
        self.replace(&stages, clock::now_ns(), Some((child, process)))?;
        self.watchdog.restarted();
        self.has_swapped(child);
        self.await_trial(child, client);
        Ok(())
    }

    /// Ends a process; returns whether it has left no scan without a pose. Then the one after it numbers scans as it would have, and no
    /// other process need be restarted with it.
    fn ends_between_scans(&mut self, child: usize) -> Result<bool, SuperviseError> {
        self.children[child].kill();
        self.children[child].await_end()?;
        Ok(!self.has_scans_in_flight())
    }

    fn has_swapped(&mut self, child: usize) {
        let plan = self.children[child].plan();
        self.swaps.push(Swapped {
            stage: plan.name.clone(),
            command: plan.command.clone(),
            after_poses: self.poses_so_far(),
        });
        (self.observe)(Event::Swapped {
            stage: &plan.name,
            command: &plan.command,
        });
    }

    /// Goes back to the program before a swap, from the next start on; false if there was none.
    pub(crate) fn go_back(&mut self, child: usize, reason: &str) -> bool {
        let failed = self.children[child].plan().command.join(" ");
        let has_gone_back = self.children[child].go_back(&self.plan.stages[child]);
        if has_gone_back {
            self.fail_trial(child, &failed, reason);
            let plan = self.children[child].plan();
            self.swaps.push(Swapped {
                stage: plan.name.clone(),
                command: plan.command.clone(),
                after_poses: self.poses_so_far(),
            });
            (self.observe)(Event::WentBack {
                stage: &plan.name,
                reason,
            });
        }
        has_gone_back
    }

    /// Returns whether a scan has been published whose pose is not there. Unknown counts as yes.
    fn has_scans_in_flight(&self) -> bool {
        let poses = self.newest.map_or(0, |newest| newest.published + 1);
        schedule::read(&self.plan.manifest).is_none_or(|source| source.published > poses)
    }
}
