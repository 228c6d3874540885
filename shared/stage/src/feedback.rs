//! The motions that masking compensates the sweep with: by id, never by time.
//!
//! A motion comes twice: from the search as soon as it is known, and with its pose once that is journalled. Whichever is first
//! will do only if both say the same, and a refined motion is not what the search said. So all that is learnt here is the motion
//! as searched, which refinement passes on unchanged. After a restart those before the last pose come from the journal, those
//! after it from the search, which works them out anew.

use std::collections::VecDeque;

use gyre_messages::{Item, Motion, Pose, SearchedMotion, flag};

use crate::{
    StageError,
    reader::Port,
    services::{Listener, Node},
};

/// Motions kept: more than any window and lag can ask for.
const KEPT: usize = 256;

/// See the module.
pub(crate) struct Feedback {
    motions: Port<Motion>,
    poses: Port<Pose>,
    known: VecDeque<(u64, Option<SearchedMotion>)>,
    sync: Option<Item>,
    newest_pose: Option<u64>,
}

impl Feedback {
    pub(crate) fn open(node: &Node) -> Result<Self, StageError> {
        Ok(Self {
            motions: Port::open(node)?,
            poses: Port::open(node)?,
            known: VecDeque::with_capacity(KEPT + 1),
            sync: None,
            newest_pose: None,
        })
    }

    /// Takes in all that has come.
    pub(crate) fn update(&mut self) -> Result<(), StageError> {
        while let Some(received) = self.motions.receive()? {
            self.learn(received.item(), received.header().motion.as_searched());
        }
        while let Some(received) = self.poses.receive()? {
            let (item, header) = (*received.item(), received.header());
            if item.is(flag::END) {
                continue;
            }
            if !item.is(flag::BASE) {
                self.learn(&item, header.motion.as_searched());
                self.newest_pose = self.newest_pose.max(Some(item.seq));
            }
            if item.is(flag::SYNC) {
                self.sync = Some(item);
            }
        }
        Ok(())
    }

    fn learn(&mut self, item: &Item, motion: SearchedMotion) {
        if item.is(flag::END) || self.known.iter().any(|(seq, _)| *seq == item.seq) {
            return;
        }
        // Where the chain starts there is no motion.
        let motion = (!item.is(flag::BREAK)).then_some(motion);
        let place = self.known.partition_point(|(seq, _)| *seq < item.seq);
        self.known.insert(place, (item.seq, motion));
        if self.known.len() > KEPT {
            self.known.pop_front();
        }
    }

    /// The motion of item `seq`: `None` as long as it is not known, `Some(None)` where the chain starts.
    pub(crate) fn motion(&self, seq: u64) -> Option<Option<SearchedMotion>> {
        self.known
            .iter()
            .rev()
            .find(|(known, _)| *known == seq)
            .map(|(_, motion)| *motion)
    }

    /// Where the trajectory stood when its keeper said so: `None` until then.
    pub(crate) fn sync(&self) -> Option<&Item> {
        self.sync.as_ref()
    }

    /// The newest pose's item; `None` before the first.
    pub(crate) fn newest_pose(&self) -> Option<u64> {
        self.newest_pose
    }

    pub(crate) fn listeners(&self) -> [&Listener; 2] {
        [self.motions.listener(), self.poses.listener()]
    }
}
