//! The trial of a replacing program: it lasts until the first pose that the program has worked on,
//! and the client of the swap waits for its result.

use std::time::{Duration, Instant};

use gyre_contract::control::Answer;

use super::Swaps;
use crate::{child::Child, processes::Processes, run::Run, socket::Client};

/// Time for which a client waits for the first pose, from when the program has opened its topics. A
/// radar may be switched off.
pub(super) const LIMIT: Duration = Duration::from_secs(10);

pub(super) struct Trial {
    /// The index of the process on trial.
    pub(super) process: usize,
    client: Client,
    /// When it was last seen without its topics.
    pub(super) since: Instant,
}

impl Swaps {
    /// Poses do not show the work of a follower.
    pub fn await_trial(&mut self, process: usize, child: &Child, client: Client) {
        if child.stage().is_none() {
            client.answer(&Answer::Done);
            return;
        }
        self.trial = Some(Trial {
            process,
            client,
            since: Instant::now(),
        });
    }

    /// Answers the client if the program has passed, or no scan has come for long.
    pub fn continue_trial(&mut self, processes: &Processes, run: &Run<'_>) {
        let Some(mut trial) = self.trial.take() else {
            return;
        };
        let child = &processes[trial.process];
        if child.is_starting(run) {
            trial.since = Instant::now();
        }
        match () {
            () if !child.is_on_trial => trial.client.answer(&Answer::Done),
            () if trial.since.elapsed() > LIMIT => {
                let name = child.name();
                trial.client.answer(&Answer::Untried(format!(
                    "{name} has taken over, but no scan has gone through it for {LIMIT:?}: if it fails before the first one, the program before comes back"
                )));
            }
            () if trial.client.has_gone() => {}
            () => self.trial = Some(trial),
        }
    }

    pub fn fail_trial(&mut self, process: usize, name: &str, command: &str, reason: &str) {
        let is_of_it = |trial: &mut Trial| trial.process == process;
        if let Some(trial) = self.trial.take_if(is_of_it) {
            trial.client.answer(&Answer::Refused(format!(
                "{name} continues as before, since `{command}` has failed: {reason}"
            )));
        }
    }

    /// Informs the client that the stream has ended before the first pose.
    pub fn end_trial(&mut self, processes: &Processes) {
        if let Some(trial) = self.trial.take() {
            let name = processes[trial.process].name();
            trial.client.answer(&Answer::Untried(format!(
                "{name} has taken over, but the run has ended before a scan went through it"
            )));
        }
    }
}
