//! The messages that are fed to a process: its inputs as they are admitted, and the feedback of the
//! rest of the run to its answers.

use gyre_client::{RunError, clock};
use gyre_contract::{Message, Pose, flag};

use super::{Pace, Session};

impl Session<'_> {
    /// Sends the feedback of the rest of the run to an item.
    pub(super) fn answered(&mut self, seq: u64) -> Result<(), RunError> {
        if self.newest.is_some_and(|newest| seq <= newest) || self.pace == Pace::Hold {
            return Ok(());
        }
        let first = self.newest.map_or(0, |newest| newest + 1);
        self.newest = Some(seq);
        for seq in first..=seq.min(self.reference.end()) {
            self.feed(&self.harness.topics.feedback, seq)?;
        }
        Ok(())
    }

    pub(crate) fn admit(&mut self) -> Result<(), RunError> {
        let last = self.reference.end().min(self.until.saturating_sub(1));
        while self.next <= last && self.is_admitted(self.next) {
            self.send_inputs(self.next)?;
        }
        Ok(())
    }

    fn is_admitted(&self, seq: u64) -> bool {
        match self.pace {
            Pace::Window => self.harness.rig.manifest().window.admits(seq, self.newest),
            Pace::Single => seq <= self.newest.map_or(0, |newest| newest + 1),
            Pace::Hold => false,
        }
    }

    pub(crate) fn send_inputs(&mut self, seq: u64) -> Result<(), RunError> {
        if self.harness.topics.copied().is_some() {
            self.sent_ns.entry(seq).or_insert_with(clock::now_ns);
        }
        self.feed(&self.harness.topics.forward, seq)?;
        self.next = seq + 1;
        Ok(())
    }

    pub(crate) fn feed(&self, topics: &[&'static str], seq: u64) -> Result<(), RunError> {
        for topic in topics {
            if let Some(message) = self.reference.get(topic, seq) {
                self.harness.feed(topic, message)?;
            }
        }
        Ok(())
    }

    /// Publishes the inputs again as after a restart of all stages: the last poses, and of the
    /// items so far only those that a restarted stage may need. Those after them follow as they are
    /// admitted.
    pub(crate) fn restart_inputs(&mut self, newest_pose: u64) -> Result<(), RunError> {
        self.harness.open_feeds()?;
        self.republish_poses(newest_pose)?;
        let look_back = self.harness.rig.manifest().window.look_back as u64;
        self.newest = Some(newest_pose);
        self.next = (newest_pose + 1).saturating_sub(look_back);
        Ok(())
    }

    fn republish_poses(&mut self, newest: u64) -> Result<(), RunError> {
        let history = Pose::sizes(&self.harness.rig.manifest().window).history as u64;
        for seq in (newest + 1).saturating_sub(history)..=newest {
            let Some(pose) = self.reference.get(Pose::TOPIC, seq) else {
                continue;
            };
            let mut item = pose.item();
            if seq < newest {
                item.flags &= !flag::SYNC;
            }
            self.harness.feed(Pose::TOPIC, &pose.about(&item))?;
        }
        Ok(())
    }
}
