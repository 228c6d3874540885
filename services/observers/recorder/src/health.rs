//! The health of the run, as its supervisor reports it. In a recording it shows later when a
//! process died.

use std::{
    path::PathBuf,
    sync::mpsc::{self, Receiver},
    thread,
    time::Duration,
};

use gyre_stage::{
    control::{Control, Status},
    usage::Usage,
};
use serde::Serialize;

const PERIOD: Duration = Duration::from_secs(1);

/// The health of a run, as `gyre ps --json` prints it.
#[derive(Serialize)]
struct Health {
    status: Status,
    /// The resources of the processes, in the order of the status.
    usage: Vec<Option<Usage>>,
}

/// Asks the supervisor of a run once a second, in a thread of its own, which ends when nobody takes
/// the reports. A supervisor that is busy answers late, and recording does not wait for it.
pub(crate) fn health(out: PathBuf) -> Receiver<String> {
    let (sender, receiver) = mpsc::sync_channel(1);
    thread::spawn(move || {
        loop {
            let answer = Control::of(&out).and_then(|run| run.status());
            let health = answer.ok().map(|status| Health {
                usage: status
                    .processes
                    .iter()
                    .map(|it| Usage::of(it.pid))
                    .collect(),
                status,
            });
            let json = health.and_then(|health| serde_json::to_string(&health).ok());
            if json.is_some_and(|json| sender.send(json).is_err()) {
                return;
            }
            thread::sleep(PERIOD);
        }
    });
    receiver
}
