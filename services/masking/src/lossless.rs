//! Lossless mode: the scans in order, each once.

use gyre_messages::{Item, Scan, Window, flag};
use gyre_stage::{
    Launch, Listener, StageError,
    inputs::Turn,
    reader::{Reader, Received},
};

use crate::scans::looks_at_two;

/// The queue of a lossless masking stage.
pub struct InOrder {
    reader: Reader<Scan>,
    window: Window,
    /// The first scan has been processed. From then on none is skipped: that would leave a gap in the output.
    started: bool,
}

impl InOrder {
    pub fn open(launch: &Launch) -> Result<Self, StageError> {
        Ok(Self {
            reader: Reader::open(launch, None)?,
            window: launch.manifest.window,
            started: false,
        })
    }

    /// Takes what has come.
    pub fn take(&mut self) -> Result<(), StageError> {
        self.reader.head().map(drop)
    }

    /// What to do with the current scan when `newest_pose` is the last one finished.
    pub fn turn(&mut self, newest_pose: Option<u64>) -> Result<Turn, StageError> {
        let Some(head) = self.reader.head()? else {
            return Ok(Turn::Wait);
        };
        let (item, received_ns) = (*head.item(), head.received_ns);
        if item.is(flag::END) {
            return Ok(Turn::End(item));
        }
        if !self.started
            && serves_only_as_before(&self.window, &item, newest_pose, self.before().is_some())
        {
            return Ok(Turn::Keep);
        }
        self.started = true;
        Ok(Turn::Process(item, received_ns))
    }

    /// The current scan, once it has been taken.
    pub fn current(&self) -> Option<&Received<Scan>> {
        self.reader.current()
    }

    /// The scan before, where the mask looks at two and the chain is unbroken.
    pub fn before(&self) -> Option<&Received<Scan>> {
        self.reader.before()
    }

    /// Steps to the next scan.
    pub fn advance(&mut self) {
        match looks_at_two(&self.window) {
            true => self.reader.advance(),
            false => self.reader.release(),
        }
    }

    /// What the source notifies.
    pub fn listener(&self) -> &Listener {
        self.reader.listener()
    }

    /// Scans skipped because they had been received before.
    pub fn duplicates(&self) -> u64 {
        self.reader.duplicates()
    }
}

/// Whether a restarted masking has nothing to publish for an item: its readers have had it, or it lacks its own scan before,
/// and its mask would be another one than before the restart.
fn serves_only_as_before(
    window: &Window,
    item: &Item,
    newest_pose: Option<u64>,
    has_before: bool,
) -> bool {
    let had = newest_pose
        .is_some_and(|newest| item.seq.saturating_add(window.look_back as u64) <= newest);
    had || (looks_at_two(window) && !has_before && !item.is(flag::BREAK))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn scan(seq: u64) -> Item {
        Item {
            seq,
            ..Item::default()
        }
    }

    #[test]
    fn a_restart_begins_with_the_last_poses_scan_and_the_one_before_it_where_masks_look_at_two() {
        let window = |look_back| Window {
            scans: 4,
            lag: 2,
            look_back,
            live_depth: 0,
        };
        let kept = |look_back, published, has_before| {
            serves_only_as_before(&window(look_back), &scan(published), Some(9), has_before)
        };
        assert!(kept(1, 8, false) && !kept(1, 9, false));
        assert!(kept(2, 7, true) && kept(2, 8, false) && !kept(2, 9, true));
        let first = Item {
            flags: flag::BREAK,
            ..scan(0)
        };
        assert!(!serves_only_as_before(&window(2), &first, None, false));
    }
}
