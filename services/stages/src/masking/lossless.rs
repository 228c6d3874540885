//! The queue of masking, and lossless mode: every scan, in order.

use gyre_contract::{Item, Scan, Window, flag};
use gyre_geometry::samples::Sample;
use gyre_stage::{Launch, inputs::Action};
use gyre_transport::{
    Listener, RunError,
    reader::{Reader, Received},
};

pub trait Queue {
    fn receive(&mut self) -> Result<(), RunError>;

    /// Returns what to do with the current scan. `resume_at` is the item of the newest pose at the
    /// last start of the sink, `newest_pose` the number of the newest pose now.
    fn next_action(
        &mut self,
        resume_at: &Item,
        newest_pose: Option<u64>,
    ) -> Result<Action, RunError>;

    fn current(&self) -> Option<&Received<Scan>>;

    /// Returns the previous scan, if the mask takes two and the chain is unbroken.
    fn previous(&self) -> Option<&Received<Scan>>;

    fn advance(&mut self);

    fn listener(&self) -> &Listener;

    fn duplicates(&self) -> u64 {
        0
    }

    fn take_dropped(&mut self) -> Vec<Sample> {
        Vec::new()
    }
}

pub struct InOrder {
    reader: Reader<Scan>,
    window: Window,
    /// True once the first scan is processed. After that no scan is skipped, which would leave a
    /// gap in the output.
    started: bool,
}

impl InOrder {
    pub fn open(launch: &Launch) -> Result<Self, RunError> {
        Ok(Self {
            reader: launch.reader(None)?,
            window: launch.manifest.window,
            started: false,
        })
    }
}

impl Queue for InOrder {
    fn receive(&mut self) -> Result<(), RunError> {
        self.reader.head().map(drop)
    }

    fn next_action(&mut self, _: &Item, newest_pose: Option<u64>) -> Result<Action, RunError> {
        let Some(head) = self.reader.head()? else {
            return Ok(Action::Wait);
        };
        let (item, received_ns) = (*head.item(), head.received_ns);
        if item.is(flag::END) {
            return Ok(Action::End(item));
        }
        if !self.started
            && serves_only_as_previous(&self.window, &item, newest_pose, self.previous().is_some())
        {
            return Ok(Action::Keep);
        }
        self.started = true;
        Ok(Action::Process(item, received_ns))
    }

    fn current(&self) -> Option<&Received<Scan>> {
        self.reader.current()
    }

    fn previous(&self) -> Option<&Received<Scan>> {
        self.reader.previous()
    }

    fn advance(&mut self) {
        match self.window.masks_pairs() {
            true => self.reader.advance(),
            false => self.reader.release(),
        }
    }

    fn listener(&self) -> &Listener {
        self.reader.listener()
    }

    fn duplicates(&self) -> u64 {
        self.reader.duplicates
    }
}

/// Returns whether a restarted masking has nothing to publish for an item: its readers have it
/// already, or its own previous scan is missing and its mask would differ from the one before the
/// restart.
fn serves_only_as_previous(
    window: &Window,
    item: &Item,
    newest_pose: Option<u64>,
    has_previous: bool,
) -> bool {
    let has_been_read = newest_pose
        .is_some_and(|newest| item.seq.saturating_add(window.look_back as u64) <= newest);
    has_been_read || (window.masks_pairs() && !has_previous && !item.is(flag::BREAK))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_restart_begins_with_the_newest_poses_scan_or_the_previous_one_if_masks_take_two() {
        let window = |look_back| Window {
            scans: 4,
            look_back,
            ..Window::default()
        };
        let kept = |look_back, published, has_previous| {
            serves_only_as_previous(
                &window(look_back),
                &Item::numbered(published),
                Some(9),
                has_previous,
            )
        };
        assert!(kept(1, 8, false) && !kept(1, 9, false));
        assert!(kept(2, 7, true) && kept(2, 8, false) && !kept(2, 9, true));
        let first = Item::numbered(0).flagged(flag::BREAK);
        assert!(!serves_only_as_previous(&window(2), &first, None, false));
    }
}
