//! The position of the source in a recording.

use gyre_contract::{Item, flag};

/// The next scan to read, and its numbers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Position {
    pub index: usize,
    /// Sequence number among the published scans. In live mode masking numbers the chain of motions
    /// itself.
    pub published: u64,
    /// The scan published before it; `None` at the start, and where it is not known.
    previous: Option<u64>,
    starts_chain: bool,
}

impl Position {
    pub fn start(first: usize) -> Self {
        Self {
            index: first,
            published: 0,
            previous: None,
            starts_chain: true,
        }
    }

    /// Resumes at the scan of the newest pose, or at the previous one if the mask takes two scans:
    /// the other stages need it as their previous scan. Without a pose it starts with scan `first`.
    pub fn resume(newest_pose: &Item, first: usize, masks_pairs: bool) -> Self {
        let newest = newest_pose;
        let in_chain = !newest.is(flag::BREAK);
        if newest.is(flag::BASE) || (masks_pairs && newest.published == 0) {
            return Self::start(first);
        }
        if masks_pairs && in_chain {
            return Self {
                index: newest.previous_scan as usize,
                published: newest.published - 1,
                previous: None,
                starts_chain: false,
            };
        }
        Self {
            index: newest.scan as usize,
            published: newest.published,
            previous: in_chain.then_some(newest.previous_scan),
            starts_chain: !in_chain,
        }
    }

    /// Continues after the newest pose, and after all published scans: a sensor measures nothing
    /// twice.
    pub fn after(newest_pose: &Item, published: u64) -> Self {
        let next = match newest_pose.is(flag::BASE) {
            true => 0,
            false => newest_pose.published + 1,
        };
        let published = next.max(published);
        Self {
            index: published as usize,
            published,
            previous: None,
            starts_chain: published == 0,
        }
    }

    pub fn break_chain(&mut self) {
        self.previous = None;
        self.starts_chain = true;
    }

    pub fn advance(&mut self) {
        self.previous = Some(self.index as u64);
        self.starts_chain = false;
        self.drop_scan();
    }

    /// Steps past a scan that is dropped. It keeps its number, so that the gap shows.
    pub fn drop_scan(&mut self) {
        self.index += 1;
        self.published = self.published.saturating_add(1);
    }

    /// Writes the numbers of the scan into its header; its times stay.
    pub fn identify(&self, item: &mut Item) {
        *item = Item {
            stamp_ns: item.stamp_ns,
            hops: item.hops,
            ..self.item()
        };
    }

    pub fn item(&self) -> Item {
        let flags = if self.starts_chain { flag::BREAK } else { 0 };
        let scan = self.index as u64;
        Item {
            seq: self.published,
            published: self.published,
            scan,
            previous_scan: self.previous.unwrap_or(scan),
            flags,
            ..Item::default()
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn newest_pose() -> Item {
        Item {
            seq: 9,
            published: 31,
            scan: 40,
            previous_scan: 37,
            ..Item::default()
        }
    }

    #[test]
    fn a_restart_begins_with_the_scan_of_the_newest_pose() {
        let resumed = |masks_pairs| Position::resume(&newest_pose(), 5, masks_pairs);
        let position = |index, published, previous| Position {
            index,
            published,
            previous,
            starts_chain: false,
        };
        assert_eq!(resumed(false), position(40, 31, Some(37)));
        assert_eq!(resumed(true), position(37, 30, None));
        let base = newest_pose().flagged(flag::BASE);
        assert_eq!(Position::resume(&base, 5, false), Position::start(5));
    }

    #[test]
    fn a_sensor_goes_on_after_all_that_was_published() {
        let base = newest_pose().flagged(flag::BASE);
        for (newest, published, next) in [
            (newest_pose(), 0, 32),
            (newest_pose(), 40, 40),
            (base, 0, 0),
        ] {
            let position = Position::after(&newest, published);
            assert_eq!(position.published, next);
            assert_eq!(position.item().is(flag::BREAK), next == 0);
        }
    }

    #[test]
    fn a_chain_starts_with_the_first_scan_and_after_a_break_also_after_a_restart() {
        let mut position = Position::start(5);
        assert!(position.item().is(flag::BREAK));
        position.advance();
        assert!(!position.item().is(flag::BREAK));
        position.break_chain();
        let newest_pose = position.item();
        assert!(newest_pose.is(flag::BREAK) && newest_pose.previous_scan == 6);
        for masks_pairs in [false, true] {
            let resumed = Position::resume(&newest_pose, 5, masks_pairs);
            assert_eq!(resumed.item(), newest_pose);
        }
        let resumed = Position::resume(&self::newest_pose(), 5, true);
        assert!(!resumed.item().is(flag::BREAK));
    }
}
