//! The generations of numbers in a recording: a live run reassigns numbers when masking restarts,
//! and earlier messages with these numbers become void.

use std::{
    collections::BTreeMap,
    ops::Bound::{Excluded, Unbounded},
};

use gyre_contract::GivenAnew;
use mcap::records::Metadata;

use crate::Entry;

const NAME: &str = "gyre.generation";

/// The first numbers of the generations that one process gives. A generation is left out if a later
/// one reassigned all its numbers, so the first numbers increase with the generations.
#[derive(Debug, Default)]
pub(crate) struct Generations(BTreeMap<u32, u64>);

impl Generations {
    /// Notes a generation; returns whether it may make messages void.
    pub fn note(&mut self, GivenAnew { generation, first }: GivenAnew) -> bool {
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

    /// Returns whether a later generation has reassigned the number of a message.
    pub fn makes_void(&self, entry: &Entry) -> bool {
        self.starts_later_by(entry.generation, entry.seq)
    }

    fn starts_later_by(&self, generation: u32, number: u64) -> bool {
        let mut later = self.0.range((Excluded(generation), Unbounded));
        later.next().is_some_and(|(_, first)| *first <= number)
    }
}

/// Describes a generation that the recorder of a topic has skipped.
pub(crate) fn to_metadata(topic: &str, skipped: GivenAnew) -> Metadata {
    let GivenAnew { generation, first } = skipped;
    Metadata {
        name: NAME.to_owned(),
        metadata: [(topic.to_owned(), format!("{generation}:{first}"))].into(),
    }
}

pub(crate) fn of_metadata(record: &Metadata) -> Option<(String, GivenAnew)> {
    let (topic, value) = record.metadata.first_key_value()?;
    let (generation, first) = value.split_once(':').filter(|_| record.name == NAME)?;
    let skipped = GivenAnew {
        generation: generation.parse().ok()?,
        first: first.parse().ok()?,
    };
    Some((topic.clone(), skipped))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn entry(generation: u32, seq: u64) -> Entry {
        Entry {
            seq,
            generation,
            ..Entry::default()
        }
    }

    #[test]
    fn a_number_is_void_if_any_later_generation_has_given_it_anew() {
        let mut generations = Generations::default();
        for (generation, first) in [(1, 0), (2, 15), (5, 30), (4, 12), (3, 20)] {
            generations.note(GivenAnew { generation, first });
        }
        let known = GivenAnew {
            generation: 5,
            first: 30,
        };
        assert!(!generations.note(known));
        for (generation, seq, is_void) in [
            (1, 11, false),
            (1, 12, true),
            (2, 29, true),
            (3, 12, true),
            (4, 29, false),
            (4, 30, true),
            (5, 99, false),
        ] {
            let entry = entry(generation, seq);
            assert_eq!(
                generations.makes_void(&entry),
                is_void,
                "{generation} {seq}"
            );
        }
    }
}
