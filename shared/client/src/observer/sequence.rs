//! The position of an observer among the items of a topic.

use gyre_contract::{GivenAnew, Item, flag};

/// The position in a sequence of items that are consecutive at the publisher, until it reuses
/// numbers.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Sequence {
    /// The number behind the newest item.
    pub next: Option<u64>,
    pub generation: u32,
    /// The first item that counts if it is missing; `None`: from the first one received.
    pub expected: Option<u64>,
    pub missed: u64,
    pub ended: bool,
}

impl Sequence {
    /// Returns the number of items missed directly before this one; `None` for an item without a
    /// scan, or one that was received before: a restarted publisher sends its last items again.
    pub fn advance(&mut self, item: &Item) -> Option<u64> {
        self.advance_past(item, None)
    }

    /// As above, where `skipped` are the numbers reused by the generations between the newest
    /// item's and this one's.
    pub(super) fn advance_past(&mut self, item: &Item, skipped: Option<GivenAnew>) -> Option<u64> {
        if item.is(flag::BASE) {
            return None;
        }
        if item.generation > self.generation {
            // Received items with reused numbers are void.
            let first = skipped.map_or(u64::MAX, |it| it.first);
            let go_back = |seq: u64| seq.min(item.numbered_from).min(first);
            (self.next, self.expected) = (self.next.map(go_back), self.expected.map(go_back));
            self.generation = item.generation;
        }
        if self.next.is_some_and(|next| item.seq < next) {
            return None;
        }
        let expected = self.next.max(self.expected).unwrap_or(item.seq);
        let missed = item.seq.saturating_sub(expected);
        self.next = Some(item.seq.saturating_add(1));
        self.missed += missed;
        self.ended = item.is(flag::END);
        (!self.ended).then_some(missed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn item(seq: u64, flags: u32) -> Item {
        Item::numbered(seq).flagged(flags)
    }

    #[test]
    fn gaps_are_counted_and_repeated_items_skipped() {
        let mut sequence = Sequence::default();
        for (seq, flags, missed) in [
            (0, flag::BASE | flag::SYNC, None),
            (5, 0, Some(0)),
            (9, 0, Some(3)),
            (8, 0, None),
            (10, flag::SYNC, Some(0)),
        ] {
            assert_eq!(sequence.advance(&item(seq, flags)), missed, "{seq}");
        }
        assert!(sequence.missed == 3 && !sequence.ended);
        // The end is no message, but messages that were missed before it count.
        assert_eq!(sequence.advance(&item(13, flag::END)), None);
        assert!(sequence.missed == 5 && sequence.ended);
    }

    #[test]
    fn items_between_what_is_known_and_the_first_received_are_missed() {
        let expecting = || Sequence {
            expected: Some(7),
            ..Sequence::default()
        };
        for (first, missed) in [(5, 0), (7, 0), (9, 2)] {
            let mut sequence = expecting();
            assert_eq!(sequence.advance(&item(first, 0)), Some(missed));
            assert_eq!(sequence.advance(&item(first + 1, 0)), Some(0));
        }
        let mut sequence = expecting();
        assert_eq!(sequence.advance(&item(4, 0)), Some(0), "an item again");
        assert_eq!(sequence.advance(&item(9, 0)), Some(2));
        let mut sequence = expecting();
        assert_eq!(sequence.advance(&item(10, flag::END)), None);
        assert_eq!(sequence.missed, 3);
    }

    fn of(generation: u32, numbered_from: u64, seq: u64) -> Item {
        Item {
            generation,
            numbered_from,
            ..item(seq, 0)
        }
    }

    #[test]
    fn numbers_that_are_given_anew_replace_those_received_and_are_counted_anew() {
        let mut sequence = Sequence::default();
        for (item, missed) in [
            (of(1, 0, 5), Some(0)),
            (of(1, 0, 6), Some(0)),
            (of(1, 0, 7), Some(0)),
            // The newest pose's again, and a pose of the journal.
            (of(2, 7, 6), None),
            (of(2, 7, 7), Some(0)),
            (of(1, 0, 6), None),
            (of(2, 7, 8), Some(0)),
            // The queue has lost the first ones of another generation.
            (of(4, 8, 12), Some(4)),
            (of(4, 8, 11), None),
        ] {
            assert_eq!(sequence.advance(&item), missed, "{item:?}");
        }
        let end = of(4, 8, 13).flagged(flag::END);
        assert_eq!(sequence.advance(&end), None);
        assert!(sequence.ended);
        assert_eq!(sequence.advance(&of(5, 13, 13)), Some(0));
        assert!(!sequence.ended, "masking was killed after the end");
    }

    #[test]
    fn an_observer_that_goes_on_after_another_one_knows_what_is_void_of_it() {
        for (generation, numbered_from, missed) in [(3, 0, 2), (4, 5, 4), (4, 8, 2)] {
            let mut sequence = Sequence {
                expected: Some(7),
                generation: 3,
                ..Sequence::default()
            };
            let first = of(generation, numbered_from, 9);
            assert_eq!(sequence.advance(&first), Some(missed));
        }
    }

    #[test]
    fn what_a_skipped_generation_gave_anew_is_missed() {
        // Items up to 14 of generation 1 are there. Generation 2 reused 7 and 8, and 3 begins
        // behind its poses.
        for (first, missed) in [(None, 0), (Some(7), 2), (Some(9), 0), (Some(12), 0)] {
            let mut sequence = Sequence {
                next: Some(15),
                generation: 1,
                ..Sequence::default()
            };
            let skipped = first.map(|first| GivenAnew {
                generation: 2,
                first,
            });
            assert_eq!(sequence.advance_past(&of(3, 9, 9), skipped), Some(missed));
            assert_eq!((sequence.next, sequence.missed), (Some(10), missed));
        }
    }
}
