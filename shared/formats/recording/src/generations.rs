//! The generations of numbers in a recording: a live run gives numbers anew when masking is started
//! again, and what had been recorded under them is void.

use std::{
    collections::BTreeMap,
    ops::Bound::{Excluded, Unbounded},
};

use gyre_messages::{Message, Scan, Sender, topic};

use crate::Entry;

/// The generations of the numbers that one process gives.
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
    /// Notes the generation of a message; returns whether it is a new one.
    pub fn note(&mut self, entry: &Entry) -> bool {
        let (generation, first) = (entry.generation, entry.numbered_from);
        generation > 0 && self.0.insert(generation, first).is_none()
    }

    /// Returns whether a later generation has given the number of a message anew.
    pub fn makes_void(&self, entry: &Entry) -> bool {
        let mut later = self.0.range((Excluded(entry.generation), Unbounded));
        later.any(|(_, first)| *first <= entry.seq)
    }
}
