//! The inputs of masking: a scan, and the motion that its sweep is motion-compensated with.

use gyre_messages::{Scan, SearchedMotion, Window};
use gyre_stage::{
    Launch, Listener, StageError,
    inputs::{Inputs, Turn},
    reader::Received,
};

use crate::{live::NewestWins, lossless::InOrder, motions::Motions};

/// See the module.
pub struct Scans {
    queue: Queue,
    motions: Motions,
    window: Window,
    /// The motion for the current scan, and that for the one before.
    found: [Option<SearchedMotion>; 2],
}

enum Queue {
    Lossless(InOrder),
    Live(NewestWins),
}

/// A scan to mask.
pub struct ScanView<'a> {
    /// The scan.
    pub scan: &'a Received<Scan>,
    /// The motion of the scan `lag` before it; `None` where there was none.
    pub motion: Option<SearchedMotion>,
    /// The scan before, where the mask looks at two; `None` where the chain starts.
    pub before: Option<ScanBefore<'a>>,
}

/// The scan before the one to mask.
pub struct ScanBefore<'a> {
    /// The scan.
    pub scan: &'a Received<Scan>,
    /// The motion that it was compensated with when it was masked.
    pub motion: Option<SearchedMotion>,
}

impl Inputs for Scans {
    type View<'a> = ScanView<'a>;

    fn open(launch: &Launch) -> Result<Self, StageError> {
        let motions = Motions::open(launch)?;
        let queue = match launch.manifest.live {
            false => Queue::Lossless(InOrder::open(launch)?),
            true => Queue::Live(NewestWins::open(launch)?),
        };
        Ok(Self {
            queue,
            motions,
            window: launch.manifest.window,
            found: [None; 2],
        })
    }

    fn turn(&mut self) -> Result<Turn, StageError> {
        match &mut self.queue {
            Queue::Lossless(queue) => queue.take()?,
            Queue::Live(queue) => queue.take()?,
        }
        self.motions.update()?;
        // The newest pose decides which scans are still needed, and in live mode where the chain resumes.
        let Some(sync) = self.motions.sync().copied() else {
            return Ok(Turn::Wait);
        };
        let newest = self.motions.newest_pose();
        let turn = match &mut self.queue {
            Queue::Lossless(queue) => queue.turn(newest)?,
            Queue::Live(queue) => queue.turn(&sync, newest)?,
        };
        match turn {
            Turn::Process(item, _) if !self.find_motions(item.seq) => Ok(Turn::Wait),
            turn => Ok(turn),
        }
    }

    fn view(&self) -> Option<ScanView<'_>> {
        let (scan, before) = match &self.queue {
            Queue::Lossless(queue) => (queue.current(), queue.before()),
            Queue::Live(queue) => (queue.current(), queue.before()),
        };
        let [motion, motion_before] = self.found;
        let before = before.map(|scan| ScanBefore {
            scan,
            motion: motion_before,
        });
        Some(ScanView {
            scan: scan?,
            motion,
            before,
        })
    }

    fn advance(&mut self) {
        match &mut self.queue {
            Queue::Lossless(queue) => queue.advance(),
            Queue::Live(queue) => queue.advance(),
        }
    }

    fn listeners(&self) -> Vec<&Listener> {
        let [motions, poses] = self.motions.listeners();
        let scans = match &self.queue {
            Queue::Lossless(queue) => queue.listener(),
            Queue::Live(queue) => queue.listener(),
        };
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
    /// Looks up the motions that scan `seq` and the one before are compensated with; false while one is still to come.
    fn find_motions(&mut self, seq: u64) -> bool {
        let before = if looks_at_two(&self.window) {
            seq.checked_sub(1)
        } else {
            None
        };
        let found =
            [Some(seq), before].map(|seq| seq.map_or(Some(None), |seq| self.motion_for(seq)));
        self.found = found.map(Option::flatten);
        found.iter().all(Option::is_some)
    }

    /// The motion for scan `seq`, by number alone, so that it is the same one after a restart.
    fn motion_for(&self, seq: u64) -> Option<Option<SearchedMotion>> {
        let lagged = if self.window.lag == 0 {
            None
        } else {
            seq.checked_sub(self.window.lag as u64)
        };
        lagged.map_or(Some(None), |seq| self.motions.of(seq))
    }
}

/// Whether the mask looks at two scans: then masking looks back at one more than the stages after it.
pub fn looks_at_two(window: &Window) -> bool {
    window.look_back > 1
}
