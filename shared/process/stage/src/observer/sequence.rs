//! The position of an observer among the items of a topic.

use gyre_messages::{GivenAnew, Item, flag};

/// The position in a sequence of items that are consecutive at the publisher, until it reuses
/// numbers.
#[derive(Debug, Default, PartialEq, Eq)]
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
        Item {
            seq,
            flags,
            ..Item::default()
        }
    }

    #[test]
    fn gaps_are_counted_and_repeated_items_skipped() {
        let mut sequence = Sequence::default();
        assert_eq!(sequence.advance(&item(0, flag::BASE | flag::SYNC)), None);
        assert_eq!(sequence.advance(&item(5, 0)), Some(0));
        assert_eq!(sequence.advance(&item(9, 0)), Some(3));
        assert_eq!(sequence.advance(&item(8, 0)), None);
        assert_eq!(sequence.advance(&item(10, flag::SYNC)), Some(0));
        assert_eq!(sequence.missed, 3);
        assert!(!sequence.ended);
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

    #[test]
    fn numbers_that_are_given_anew_replace_those_received_and_are_counted_anew() {
        let of = |generation, numbered_from, seq| Item {
            generation,
            numbered_from,
            ..item(seq, 0)
        };
        let mut sequence = Sequence::default();
        for seq in 5..10 {
            assert_eq!(sequence.advance(&of(1, 0, seq)), Some(0));
        }
        assert_eq!(
            sequence.advance(&of(2, 7, 6)),
            None,
            "the newest pose's again"
        );
        assert_eq!(sequence.advance(&of(2, 7, 7)), Some(0));
        assert_eq!(
            sequence.advance(&of(1, 0, 6)),
            None,
            "a pose of the journal"
        );
        assert_eq!(sequence.advance(&of(2, 7, 8)), Some(0));
        assert_eq!(sequence.missed, 0);
        // The queue has lost the first ones of another generation.
        assert_eq!(sequence.advance(&of(4, 8, 12)), Some(4));
        assert_eq!(sequence.advance(&of(4, 8, 11)), None);
        let end = Item {
            flags: flag::END,
            ..of(4, 8, 13)
        };
        assert_eq!(sequence.advance(&end), None);
        assert!(sequence.ended);
        assert_eq!(sequence.advance(&of(5, 13, 13)), Some(0));
        assert!(
            !sequence.ended,
            "masking was killed after the end of the stream"
        );
    }

    #[test]
    fn an_observer_that_goes_on_after_another_one_knows_what_is_void_of_it() {
        for (generation, numbered_from, missed) in [(3, 0, 2), (4, 5, 4), (4, 8, 2)] {
            let mut sequence = Sequence {
                expected: Some(7),
                generation: 3,
                ..Sequence::default()
            };
            let first = Item {
                generation,
                numbered_from,
                ..item(9, 0)
            };
            assert_eq!(sequence.advance(&first), Some(missed));
        }
    }

    #[test]
    fn what_a_skipped_generation_gave_anew_is_missed() {
        // Items up to 14 of generation 1 are there. Generation 2 reused 7 and 8, and 3 begins
        // behind its poses.
        let skipped = |first| GivenAnew {
            generation: 2,
            first,
        };
        for (skipped, missed) in [
            (None, 0),
            (Some(skipped(7)), 2),
            (Some(skipped(9)), 0),
            (Some(skipped(12)), 0),
        ] {
            let mut sequence = Sequence {
                next: Some(15),
                generation: 1,
                ..Sequence::default()
            };
            let first = Item {
                generation: 3,
                numbered_from: 9,
                ..item(9, 0)
            };
            assert_eq!(sequence.advance_past(&first, skipped), Some(missed));
            assert_eq!((sequence.next, sequence.missed), (Some(10), missed));
        }
    }

    #[test]
    fn the_end_is_no_message_but_what_was_missed_before_it_counts() {
        let mut sequence = Sequence::default();
        assert_eq!(sequence.advance(&item(1, 0)), Some(0));
        assert_eq!(sequence.advance(&item(4, flag::END)), None);
        assert!(sequence.ended);
        assert_eq!(sequence.missed, 2);
    }
}
