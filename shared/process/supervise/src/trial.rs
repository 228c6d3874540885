//! The trial of a program that has taken the place of another one: it lasts until the first pose that the program has worked on, and
//! who has asked for the swap waits for its result.

use std::time::{Duration, Instant};

use gyre_stage::control::Answer;

use crate::{Supervisor, socket::Client};

/// Time for which a client waits for the first pose, from when the program has opened its topics. A radar may be switched off.
const LIMIT: Duration = Duration::from_secs(10);

/// A client that waits for the result.
pub(crate) struct Trial {
    /// The index of the process on trial.
    child: usize,
    client: Client,
    /// When it was last seen without its topics.
    since: Instant,
}

impl Supervisor<'_> {
    /// Lets the client of a swap wait. Of a follower no pose says what it does: so its swap is done when it is started.
    pub(crate) fn await_trial(&mut self, child: usize, client: Client) {
        if self.children[child].follows() {
            client.answer(&Answer::Done);
            return;
        }
        self.trial = Some(Trial {
            child,
            client,
            since: Instant::now(),
        });
    }

    /// Answers the client if the program has passed, or no scan has come for long.
    pub(crate) fn continue_trial(&mut self) {
        let Some(mut trial) = self.trial.take() else {
            return;
        };
        let child = &self.children[trial.child];
        let is_starting = |stage| !self.services.has_publisher(stage);
        if child.stage().is_some_and(is_starting) {
            trial.since = Instant::now();
        }
        match () {
            () if !child.is_on_trial() => trial.client.answer(&Answer::Done),
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

    /// Tells the client that the program has failed, and the one before is started again.
    pub(crate) fn fail_trial(&mut self, child: usize, command: &str, reason: &str) {
        let is_of_it = |trial: &mut Trial| trial.child == child;
        if let Some(trial) = self.trial.take_if(is_of_it) {
            trial.client.answer(&Answer::Refused(format!(
                "{} goes on as before, since `{command}` has failed: {reason}",
                self.children[child].name()
            )));
        }
    }

    /// Tells the client that the stream has ended before the first pose.
    pub(crate) fn end_trial(&mut self) {
        if let Some(trial) = self.trial.take() {
            let name = self.children[trial.child].name();
            trial.client.answer(&Answer::Untried(format!(
                "{name} has taken over, but the run has ended before a scan went through it"
            )));
        }
    }
}
