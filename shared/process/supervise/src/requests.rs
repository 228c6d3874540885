//! Requests from other processes: requests at the control socket, and the answers.

use std::{env, path::Path, process};

use gyre_contract::{
    Command, Commands, StageId,
    control::{Activity, Answer, Phase, ProcessStatus, Request, Status, Swap},
};
use gyre_stage::schedule;
use gyre_transport::{
    RunError, clock, received,
    wake::{MAX_WAIT, Signals, request_stop},
};

use crate::{
    StagePlan, SuperviseError,
    child::Child,
    socket::{Client, ControlSocket},
    supervisor::Supervisor,
    swaps::{Standby, plan_of},
};

/// Requests that are answered before the supervisor looks after its processes again.
const MAX_REQUESTS: usize = 8;

/// Waits until `look`, which updates the status, returns something, before there are processes.
/// `None`: the run is to end.
pub fn wait<T>(
    root: &Path,
    signals: &Signals,
    mut status: Status,
    mut look: impl FnMut(&mut Status) -> Option<T>,
) -> Result<Option<T>, RunError> {
    let socket = ControlSocket::open(root)?;
    loop {
        if let Some(found) = look(&mut status) {
            return Ok(Some(found));
        }
        let requests = Some(socket.descriptor());
        if signals.wait_or_readable(&[], &[], requests, MAX_WAIT)?.stop {
            return Ok(None);
        }
        while let Some((request, client)) = socket.next() {
            match request {
                Request::Status => client.answer(&Answer::Status(Box::new(status.clone()))),
                Request::Stop => {
                    client.answer(&Answer::Done);
                    return Ok(None);
                }
                _ => client.answer(&Answer::Refused("the run has no processes yet".to_owned())),
            }
        }
    }
}

impl Supervisor<'_> {
    /// Answers the requests that have come. One to stop is the signal to stop, for all who look for
    /// that in this process.
    pub(crate) fn serve(&mut self) -> Result<(), SuperviseError> {
        for _ in 0..MAX_REQUESTS {
            let Some((request, client)) = self.socket.next() else {
                break;
            };
            match request {
                Request::Status => client.answer(&Answer::Status(Box::new(self.status()))),
                Request::Stop => {
                    request_stop()?;
                    client.answer(&Answer::Done);
                }
                Request::Restart { process } => self.restart_on_request(&process, client)?,
                Request::Swap(swap) => self.begin_swap(&swap, client)?,
                Request::Command(command) => client.answer(&match self.number(command) {
                    Ok(number) => Answer::Numbered(number),
                    Err(reason) => Answer::Refused(reason),
                }),
            }
        }
        Ok(())
    }

    /// Keeps a command for masking, which applies it to the next scan, and returns its number.
    fn number(&self, command: Command) -> Result<u64, String> {
        let manifest = &self.run.plan.manifest;
        let (slam, localises) = (manifest.window.slam, manifest.window.localises);
        let missing = match command {
            _ if self.followers.are_awaited => {
                Some("the last scan has passed: no scan takes a command")
            }
            _ if !self.run.plan.takes_commands => {
                Some("commands need masking and pose-integration in one run: here one is absent")
            }
            Command::Reset { keep_map: true, .. } | Command::NewMap {} if !slam => {
                Some("the run has no map: that needs slam.kind")
            }
            Command::Locate { .. } if !localises => {
                Some("the run localises in no map: that needs slam.map, with slam.kind")
            }
            _ => None,
        };
        if let Some(missing) = missing {
            return Err(missing.to_owned());
        }
        command.check()?;
        let added = Commands::open(&manifest.out).and_then(|mut commands| commands.add(command));
        added.map_err(|error| error.to_string())
    }

    fn refuse_unknown(&self, process: &str, client: Client) {
        let names: Vec<&str> = self.run.plan.names().collect();
        let names = names.join(", ");
        client.answer(&Answer::Refused(format!(
            "the run has no process `{process}`; it has {names}"
        )));
    }

    /// It counts as a restart and not as a death.
    fn restart_on_request(&mut self, name: &str, client: Client) -> Result<(), SuperviseError> {
        let Some(process) = self.run.plan.named(name) else {
            let newest = self.poses.newest_seq();
            match &mut self.recorder {
                Some(recorder) if recorder.name() == name => {
                    recorder.restart(&mut self.run, newest)?;
                    client.answer(&Answer::Done);
                }
                _ => self.refuse_unknown(name, client),
            }
            return Ok(());
        };
        let stages = self.run.plan.restarted_with(process);
        let why_not = self.processes.why_not_again(stages.iter().copied());
        client.answer(&match why_not {
            Some(reason) => Answer::Refused(reason),
            None => {
                self.restart_and_count(&stages)?;
                Answer::Done
            }
        });
        Ok(())
    }

    fn restart_and_count(&mut self, stages: &[usize]) -> Result<(), SuperviseError> {
        stages.iter().for_each(|i| self.processes.count_restart(*i));
        self.restart(stages, clock::now_ns())
    }

    /// The client has its answer when the new program has worked on a first pose.
    fn begin_swap(&mut self, swap: &Swap, client: Client) -> Result<(), SuperviseError> {
        let Some(process) = self.run.plan.named(&swap.process) else {
            self.refuse_unknown(&swap.process, client);
            return Ok(());
        };
        if let Some(reason) = self.swaps.why_not_now(self.followers.are_awaited) {
            client.answer(&Answer::Refused(reason.to_owned()));
            return Ok(());
        }
        let plan = plan_of(&self.run.plan.stages[process], swap);
        match swap.cold {
            true => self.swap_cold(process, plan, client),
            false => self.swaps.begin(process, &plan, client, &self.run),
        }
    }

    /// If the new program cannot be started, the one before is started again.
    fn swap_cold(
        &mut self,
        process: usize,
        plan: StagePlan,
        client: Client,
    ) -> Result<(), SuperviseError> {
        let stages = self.run.plan.restarted_with(process);
        if let Some(reason) = self.why_others_stay(process, &stages) {
            client.answer(&Answer::Refused(reason));
            return Ok(());
        }
        self.processes[process].change(plan);
        self.restart_and_count(&stages)?;
        let child = &mut self.processes[process];
        if child.is_on_trial {
            self.has_swapped(process, client);
            return Ok(());
        }
        let reason = child.start_error.take().unwrap_or_default();
        let name = child.name();
        client.answer(&Answer::Refused(format!(
            "{name} continues as before: {reason}"
        )));
        Ok(())
    }

    /// Returns why the processes that are restarted together with one could not be.
    fn why_others_stay(&self, process: usize, stages: &[usize]) -> Option<String> {
        let others = stages.iter().copied().filter(|i| *i != process);
        self.processes.why_not_again(others)
    }

    pub(crate) fn continue_swap(&mut self) -> Result<(), SuperviseError> {
        let is_in_flight = || self.poses.are_owed(self.run.manifest());
        match self.swaps.step(&self.run, is_in_flight) {
            None => Ok(()),
            Some((standby, Ok(()))) => self.take_over(standby),
            Some((standby, Err(reason))) => {
                self.give_up(standby, &reason);
                Ok(())
            }
        }
    }

    pub(crate) fn give_up(&self, standby: Standby, reason: &str) {
        let Standby { child, client, .. } = standby;
        let (name, command) = (child.name(), child.plan.command.join(" "));
        client.answer(&Answer::Refused(format!(
            "{name} continues as before, since `{command}` cannot take over: {reason}"
        )));
        let pid = child.pid();
        // Its end is waited for.
        drop(child);
        self.run.guardian.forget(pid);
    }

    /// Ends the replaced program, and lets the new one continue.
    fn take_over(&mut self, standby: Standby) -> Result<(), SuperviseError> {
        let process = standby.process;
        let stages = self.run.plan.restarted_with(process);
        if let Some(reason) = self.why_others_stay(process, &stages) {
            self.give_up(standby, &reason);
            return Ok(());
        }
        let Standby { child, client, .. } = standby;
        self.processes[process].kill();
        self.processes[process].await_end()?;
        // If the one before has left no scan without a pose, the one after it numbers scans as it
        // would have, and no other process need be restarted with it.
        let stages = match self.poses.are_owed(self.run.manifest()) {
            true => stages,
            false => vec![process],
        };
        self.replace(&stages, clock::now_ns(), Some((process, child)))?;
        self.stalls.restarted();
        self.has_swapped(process, client);
        Ok(())
    }

    fn has_swapped(&mut self, process: usize, client: Client) {
        let child = &self.processes[process];
        self.swaps.has_swapped(&child.plan, self.poses.count());
        let (name, command) = (child.name(), child.plan.command.join(" "));
        self.run
            .note(&format!("{name} is `{command}` from here on"));
        self.swaps.await_trial(process, child, client);
    }

    fn status(&self) -> Status {
        let manifest = self.run.manifest();
        let status = |(child, begun): (&Child, &StagePlan)| {
            let restarts = self.processes.restarts.get(child.name());
            let is_source = child.stage() == Some(StageId::RadarReplay);
            ProcessStatus {
                is_swapped: child.plan.command != begun.command,
                restarts: restarts.copied().unwrap_or_default(),
                received: is_source.then(|| received::read(manifest)).flatten(),
                ..child.status(&self.run, Activity::Running)
            }
        };
        let begun = &self.run.plan.stages;
        let mut processes: Vec<_> = self.processes.iter().zip(begun).map(status).collect();
        let is_starting = |process: &ProcessStatus| process.activity == Activity::Starting;
        let is_deaf = |process: &ProcessStatus| process.received.is_some_and(|it| !it.is_receiving);
        let phase = match () {
            () if self.followers.are_awaited => Phase::Following,
            () if processes.iter().any(is_starting) => Phase::Starting,
            () if processes.iter().any(is_deaf) => Phase::WaitingForRadar,
            () => Phase::Running,
        };
        // Nothing waits for it.
        processes.extend(self.recorder.iter().map(|it| it.status(&self.run)));
        Status {
            pid: process::id(),
            out: manifest.out.clone(),
            started_in: env::current_dir().unwrap_or_default(),
            live: manifest.live,
            phase,
            uptime_s: self.run.since.elapsed().as_secs_f64(),
            published: schedule::read(manifest).map(|source| source.published),
            poses: self.poses.count(),
            dropped: self.poses.dropped(),
            last_pose_s: self.poses.age_s(),
            disk_is_full: self.notice.is_some(),
            notice: self.notice.clone(),
            swap: self.swaps.pending(&self.processes, &self.run),
            processes,
        }
    }
}
