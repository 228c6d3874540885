//! The inputs of masking: a scan and the motion for its motion compensation.

use gyre_messages::{Item, Scan, SearchedMotion, Window, flag};
use gyre_radar::LostAzimuths;
use gyre_stage::{
    Launch, Listener, StageError,
    inputs::{Action, Inputs},
    reader::Received,
};

use crate::{live::NewestOnly, lossless::InOrder, motions::Motions};

/// The scans, in lossless or in live mode, and the motions.
pub struct Scans {
    queue: Queue,
    motions: Motions,
    window: Window,
    /// The motions for the current and for the previous scan.
    found: [Option<SearchedMotion>; 2],
    /// Where azimuths of both were lost, if they have poses.
    lost: [Option<LostAzimuths>; 2],
}

enum Queue {
    Lossless(InOrder),
    Live(NewestOnly),
}

/// A scan to mask.
pub struct ScanView<'a> {
    /// The scan.
    pub scan: &'a Received<Scan>,
    /// The motion of the scan `lag` scans earlier; `None` without one.
    pub motion: Option<SearchedMotion>,
    /// Where its azimuths were lost, if it has a pose from before a restart.
    pub lost: Option<LostAzimuths>,
    /// The previous scan, if the mask takes two; `None` where the chain starts.
    pub previous: Option<PreviousScan<'a>>,
}

/// The scan before the one to mask.
pub struct PreviousScan<'a> {
    /// The scan.
    pub scan: &'a Received<Scan>,
    /// The motion with which it was compensated.
    pub motion: Option<SearchedMotion>,
    /// Where its azimuths were lost, if it has a pose.
    pub lost: Option<LostAzimuths>,
}

impl Inputs for Scans {
    type View<'a> = ScanView<'a>;

    fn open(launch: &Launch) -> Result<Self, StageError> {
        let motions = Motions::open(launch)?;
        let queue = match launch.manifest.live {
            false => Queue::Lossless(InOrder::open(launch)?),
            true => Queue::Live(NewestOnly::open(launch)?),
        };
        Ok(Self {
            queue,
            motions,
            window: launch.manifest.window,
            found: [None; 2],
            lost: [None; 2],
        })
    }

    fn next_action(&mut self) -> Result<Action, StageError> {
        match &mut self.queue {
            Queue::Lossless(queue) => queue.receive()?,
            Queue::Live(queue) => queue.receive()?,
        }
        self.motions.update()?;
        // The newest pose decides which scans are still needed, and in live mode where the chain
        // resumes.
        let Some(resume_at) = self.motions.resume_at().copied() else {
            return Ok(Action::Wait);
        };
        let newest_pose = self.motions.newest_pose();
        let action = match &mut self.queue {
            Queue::Lossless(queue) => queue.next_action(newest_pose)?,
            Queue::Live(queue) => queue.next_action(&resume_at, newest_pose)?,
        };
        match action {
            Action::Process(item, _) if !self.find_motions(&item) => Ok(Action::Wait),
            action => Ok(action),
        }
    }

    fn view(&self) -> Option<ScanView<'_>> {
        let (scan, previous) = match &self.queue {
            Queue::Lossless(queue) => (queue.current(), queue.previous()),
            Queue::Live(queue) => (queue.current(), queue.previous()),
        };
        let [motion, previous_motion] = self.found;
        let [lost, previous_lost] = self.lost;
        let previous = previous.map(|scan| PreviousScan {
            scan,
            motion: previous_motion,
            lost: previous_lost,
        });
        Some(ScanView {
            scan: scan?,
            motion,
            lost,
            previous,
        })
    }

    fn advance(&mut self) {
        match &mut self.queue {
            Queue::Lossless(queue) => queue.advance(),
            Queue::Live(queue) => queue.advance(),
        }
    }

    fn listeners(&self) -> Vec<&Listener> {
        let (scans, lacks_scan) = match &self.queue {
            Queue::Lossless(queue) => (queue.listener(), queue.current().is_none()),
            Queue::Live(queue) => (queue.listener(), queue.current().is_none()),
        };
        // Motions and poses are read when a scan comes.
        if lacks_scan && self.motions.resume_at().is_some() {
            return vec![scans];
        }
        let [motions, poses] = self.motions.listeners();
        vec![scans, motions, poses]
    }

    fn duplicates(&self) -> u64 {
        match &self.queue {
            Queue::Lossless(queue) => queue.duplicates(),
            Queue::Live(_) => 0,
        }
    }
}

impl Scans {
    /// Looks up the motions for a scan and the previous one; false while one is missing. They
    /// depend on the numbers alone, so they are the same after a restart.
    fn find_motions(&mut self, item: &Item) -> bool {
        if item.is(flag::BREAK) {
            self.motions.start_chain(item.seq);
        }
        let previous = item
            .seq
            .checked_sub(1)
            .filter(|_| self.window.masks_pairs());
        let found = [Some(item.seq), previous]
            .map(|seq| seq.map_or(Some(None), |seq| self.motion_for(seq)));
        self.found = found.map(Option::flatten);
        self.lost = [Some(item.seq), item.seq.checked_sub(1)].map(|seq| self.motions.lost(seq?));
        found.iter().all(Option::is_some)
    }

    fn motion_for(&self, seq: u64) -> Option<Option<SearchedMotion>> {
        match self.window.lag {
            0 => Some(None),
            lag => self.motions.before(seq, lag as u64),
        }
    }
}
