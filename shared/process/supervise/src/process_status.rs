//! The state of a process as `gyre ps` shows it.

use gyre_stage::{
    control::{Activity, ProcessStatus},
    heartbeat,
};

use crate::{child::Child, run::Run};

/// Returns the state of a process, whose activity is `otherwise` where it writes no heartbeat.
pub(crate) fn status_of(child: &Child, run: &Run<'_>, otherwise: Activity) -> ProcessStatus {
    let beat = child.heartbeat(run.manifest());
    let activity = match beat {
        _ if child.is_known_to_have_exited() => Activity::Ended,
        _ if run.is_starting(child) => Activity::Starting,
        None => otherwise,
        Some(beat) if beat.is_silent() => Activity::Silent,
        Some(beat) => match beat.activity {
            heartbeat::Activity::Works => Activity::Working,
            heartbeat::Activity::Waits => Activity::Waiting,
        },
    };
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
