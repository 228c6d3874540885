//! The generations of numbers in a recording: a live run gives numbers anew when masking is started
//! again, and what had been recorded under them is void.

use std::{
    collections::BTreeMap,
    ops::Bound::{Excluded, Unbounded},
};

use gyre_messages::{Message, Scan, Sender, topic};

use crate::Entry;

/// The first numbers of the generations that one process gives. One is left out whose numbers a
/// later one has all given anew, so that the first numbers grow with the generations.
#[derive(Debug, Default)]
pub(crate) struct Generations(BTreeMap<u32, u64>);

/// The process that numbers the messages of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum NumberedBy {
    Source,
    /// In live mode; otherwise it has the numbers of the source.
    Masking,
    /// A follower, whose numbers are those of its results.
    Follower,
}

impl NumberedBy {
    pub fn of(name: &str) -> Self {
        match topic(name).map(|topic| topic.sender) {
            _ if name == Scan::TOPIC => Self::Source,
            Some(Sender::Stage(_)) => Self::Masking,
            _ => Self::Follower,
        }
    }
}

impl Generations {
    /// Notes the generation of a message; returns whether it may make others void.
    pub fn note(&mut self, entry: &Entry) -> bool {
        let (generation, first) = (entry.generation, entry.numbered_from);
        let is_known = self.0.contains_key(&generation) || self.starts_later_by(generation, first);
        if generation == 0 || is_known {
            return false;
        }
        while let Some((&earlier, &number)) = self.0.range(..generation).next_back()
            && number >= first
        {
            self.0.remove(&earlier);
        }
        self.0.insert(generation, first);
        true
    }

    /// Returns whether a later generation has given the number of a message anew.
    pub fn makes_void(&self, entry: &Entry) -> bool {
        self.starts_later_by(entry.generation, entry.seq)
    }

    /// Returns whether a later generation begins with this number, or an earlier one.
    fn starts_later_by(&self, generation: u32, number: u64) -> bool {
        let mut later = self.0.range((Excluded(generation), Unbounded));
        later.next().is_some_and(|(_, first)| *first <= number)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(generation: u32, numbered_from: u64, seq: u64) -> Entry {
        Entry {
            seq,
            generation,
            numbered_from,
            ..Entry::default()
        }
    }

    #[test]
    fn a_number_is_void_if_any_later_generation_has_given_it_anew() {
        let mut generations = Generations::default();
        for (generation, first) in [(1, 0), (2, 15), (5, 30), (4, 12), (3, 20)] {
            generations.note(&entry(generation, first, first));
        }
        assert!(!generations.note(&entry(5, 30, 31)), "known");
        for (generation, seq, is_void) in [
            (1, 11, false),
            (1, 12, true),
            (2, 29, true),
            (3, 12, true),
            (4, 29, false),
            (4, 30, true),
            (5, 99, false),
        ] {
            let entry = entry(generation, 0, seq);
            assert_eq!(
                generations.makes_void(&entry),
                is_void,
                "{generation} {seq}"
            );
        }
    }
}
