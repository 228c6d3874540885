//! Requests from other processes: what is asked at the control socket, and the answers.

use std::process;

use gyre_messages::StageId;
use gyre_stage::{
    clock,
    control::{Activity, Answer, Phase, ProcessStatus, Request, Status},
    heartbeat::{self, Heartbeat},
    schedule,
    source::received_of,
};

use crate::{SuperviseError, Supervisor, child::Child, socket::Client};

/// Requests that are answered before the supervisor looks after its processes again.
const MAX_REQUESTS: usize = 8;

impl Supervisor<'_> {
    /// Answers the requests that have come; true if one of them is to stop.
    pub(crate) fn serve(&mut self) -> Result<bool, SuperviseError> {
        let mut stop = false;
        for _ in 0..MAX_REQUESTS {
            let Some((request, client)) = self.socket.next() else {
                break;
            };
            match request {
                Request::Status => client.answer(&Answer::Status(self.status())),
                Request::Stop => {
                    stop = true;
                    client.answer(&Answer::Done);
                }
                Request::Restart { process } => match self.named(&process) {
                    Some(child) => {
                        let answer = self.restart_on_request(child)?;
                        client.answer(&answer);
                    }
                    None if self.is_recorder(&process) => {
                        self.restart_recorder()?;
                        client.answer(&Answer::Done);
                    }
                    None => self.refuse_unknown(&process, client),
                },
                Request::Swap(swap) => self.begin_swap(swap, client)?,
            }
        }
        Ok(stop)
    }

    /// Returns the index of a process.
    pub(crate) fn named(&self, process: &str) -> Option<usize> {
        let mut children = self.children.iter();
        children.position(|child| child.name() == process)
    }

    pub(crate) fn refuse_unknown(&self, process: &str, client: Client) {
        let names: Vec<&str> = self.children.iter().map(Child::name).collect();
        let names = names.join(", ");
        client.answer(&Answer::Refused(format!(
            "the run has no process `{process}`; it has {names}"
        )));
    }

    /// Ends a process and starts it again, which counts as a restart and not as a death. One that could not be started again goes on.
    fn restart_on_request(&mut self, child: usize) -> Result<Answer, SuperviseError> {
        let stages = self.restarted_with(child);
        if let Some(reason) = self.why_not_again(stages.iter().copied()) {
            return Ok(Answer::Refused(reason));
        }
        self.restart_and_count(&stages)?;
        Ok(Answer::Done)
    }

    pub(crate) fn restart_and_count(&mut self, stages: &[usize]) -> Result<(), SuperviseError> {
        stages.iter().for_each(|i| self.count_restart(*i));
        self.restart(stages, clock::now_ns())
    }

    fn status(&mut self) -> Status {
        let manifest = &self.plan.manifest;
        let processes = (0..self.children.len()).map(|i| self.status_of(i));
        let mut processes: Vec<ProcessStatus> = processes.collect();
        let is_starting = |process: &ProcessStatus| process.activity == Activity::Starting;
        let phase = match () {
            () if self.is_following => Phase::Following,
            () if processes.iter().any(is_starting) => Phase::Starting,
            () => Phase::Running,
        };
        // Nothing waits for it.
        processes.extend(self.status_of_recorder());
        Status {
            pid: process::id(),
            out: manifest.out.clone(),
            live: manifest.live,
            phase,
            uptime_s: self.since.elapsed().as_secs_f64(),
            published: schedule::read(manifest).map(|source| source.published),
            poses: self.poses_so_far(),
            dropped: self.newest.map_or(0, |newest| newest.dropped()),
            last_pose_s: self.last_pose.map(|pose| pose.elapsed().as_secs_f64()),
            processes,
        }
    }

    fn status_of(&self, child: usize) -> ProcessStatus {
        let begun = &self.plan.stages[child].command;
        let child = &self.children[child];
        let beat = child.heartbeat(&self.plan.manifest);
        let is_opening = |stage: StageId| !self.services.has_publisher(stage);
        let activity = match beat {
            _ if child.is_known_to_have_exited() => Activity::Ended,
            _ if child.stage().is_some_and(is_opening) => Activity::Starting,
            None => Activity::Running,
            Some(beat) => activity(beat),
        };
        let restarts = self.restarts.get(child.name());
        ProcessStatus {
            is_swapped: child.plan().command != *begun,
            restarts: restarts.copied().unwrap_or_default(),
            received: match child.stage() {
                Some(StageId::RadarReplay) => received_of(&self.plan.manifest),
                _ => None,
            },
            ..of_child(child, beat, activity)
        }
    }
}

/// Returns what a living process does.
pub(crate) fn activity(beat: Heartbeat) -> Activity {
    match beat.activity {
        _ if beat.is_silent() => Activity::Silent,
        heartbeat::Activity::Works => Activity::Working,
        heartbeat::Activity::Waits => Activity::Waiting,
    }
}

/// Returns the state of a process that has never been restarted.
pub(crate) fn of_child(
    child: &Child,
    beat: Option<Heartbeat>,
    activity: Activity,
) -> ProcessStatus {
    ProcessStatus {
        name: child.name().to_owned(),
        pid: child.pid(),
        command: child.plan().command.clone(),
        is_swapped: false,
        activity,
        activity_s: beat.map(|beat| beat.age().as_secs_f64()),
        uptime_s: child.started().elapsed().as_secs_f64(),
        restarts: 0,
        last_death: child.last_death().map(str::to_owned),
        missed: None,
        received: None,
    }
}
