//! The state of a process as `gyre ps` shows it.

use gyre_messages::StageId;
use gyre_stage::{
    control::{Activity, ProcessStatus},
    heartbeat::{self, Heartbeat},
    source::received_of,
};

use crate::{child::Child, processes::Processes, run::Run};

pub(crate) fn status_of(process: usize, processes: &Processes, run: &Run<'_>) -> ProcessStatus {
    let child = &processes[process];
    let beat = child.heartbeat(run.manifest());
    let activity = match beat {
        _ if child.is_known_to_have_exited() => Activity::Ended,
        _ if run.is_starting(child) => Activity::Starting,
        None => Activity::Running,
        Some(beat) => activity(beat),
    };
    ProcessStatus {
        is_swapped: child.plan.command != run.plan.stages[process].command,
        restarts: processes
            .restarts
            .get(child.name())
            .copied()
            .unwrap_or_default(),
        received: match child.stage() {
            Some(StageId::RadarReplay) => received_of(run.manifest()),
            _ => None,
        },
        ..of_child(child, beat, activity)
    }
}

pub(crate) fn activity(beat: Heartbeat) -> Activity {
    match beat.activity {
        _ if beat.is_silent() => Activity::Silent,
        heartbeat::Activity::Works => Activity::Working,
        heartbeat::Activity::Waits => Activity::Waiting,
    }
}

pub(crate) fn of_child(
    child: &Child,
    beat: Option<Heartbeat>,
    activity: Activity,
) -> ProcessStatus {
    ProcessStatus {
        name: child.name().to_owned(),
        pid: child.pid(),
        command: child.plan.command.clone(),
        is_swapped: false,
        activity,
        activity_s: beat.map(|beat| beat.age().as_secs_f64()),
        uptime_s: child.started.elapsed().as_secs_f64(),
        restarts: 0,
        last_death: child.last_death.clone(),
        missed: None,
        received: None,
    }
}
