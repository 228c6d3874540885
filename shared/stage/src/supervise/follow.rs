//! The supervision of followers: they are restarted alone, and waited for at the end of the stream.

use super::{Ending, Event, SuperviseError, Supervisor};
use crate::{
    clock,
    follower::{self, Progress},
    wake,
};

impl Supervisor<'_> {
    /// Restarts dead followers. The stages do not notice.
    pub(super) fn recover_followers(&mut self, dead: &[usize]) -> Result<(), SuperviseError> {
        let died_ns = clock::now_ns();
        self.may_restart(dead)?;
        self.replace(dead, died_ns)?;
        (self.observe)(Event::Restarted { all: false });
        Ok(())
    }

    /// Waits until the followers have read the logs to their end. The stream has ended, so the death of a stage changes nothing.
    pub(super) fn await_followers(&mut self) -> Result<Ending, SuperviseError> {
        loop {
            let behind: Vec<usize> = (0..self.children.len())
                .filter(|i| self.is_behind(*i))
                .collect();
            // The others read what this one writes.
            let Some(first) = behind.first() else {
                return Ok(Ending::Complete);
            };
            let follower = self.children[*first].name();
            let progress = follower::progress_of(&self.plan.manifest, follower)
                .map_or_else(Progress::default, |(progress, _)| progress);
            (self.observe)(Event::Following { follower, progress });
            if self.signals.wait(&[], None, wake::MAX_WAIT)?.stop {
                return Ok(Ending::Interrupted);
            }
            self.logs.bound_if_due();
            self.keep_guardian();
            let is_dead = |i: &usize| self.children[*i].has_exited() && self.is_behind(*i);
            let dead: Vec<usize> = behind.into_iter().filter(is_dead).collect();
            if !dead.is_empty() {
                self.recover_followers(&dead)?;
            }
        }
    }

    /// Returns whether a process is a follower that has not come to its end.
    pub(super) fn is_behind(&self, child: usize) -> bool {
        let child = &self.children[child];
        child.follows() && !follower::is_done(&self.plan.manifest, child.name())
    }
}
