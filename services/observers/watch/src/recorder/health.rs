//! The health of the run, as its supervisor reports it. In a recording it shows later when a
//! process died.

use std::{
    path::PathBuf,
    sync::mpsc::{self, Receiver},
    thread,
    time::Duration,
};

use gyre_client::{UsedRun, control::Control};

const PERIOD: Duration = Duration::from_secs(1);

/// Asks the supervisor of a run once a second for the status that `gyre ps --json` prints, in a
/// thread that ends when nobody takes the answers. A busy supervisor answers late, and recording
/// does not wait for it.
pub(crate) fn health(out: PathBuf) -> Receiver<String> {
    let (sender, receiver) = mpsc::sync_channel(1);
    thread::spawn(move || {
        loop {
            let answer = Control::of(&out).and_then(|run| run.status());
            let health = answer.ok().map(UsedRun::of);
            let json = health.and_then(|health| serde_json::to_string(&health).ok());
            if json.is_some_and(|json| sender.send(json).is_err()) {
                return;
            }
            thread::sleep(PERIOD);
        }
    });
    receiver
}
