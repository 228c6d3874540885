//! The numbers of items that are given again.

use crate::{
    message::{Message, Sender},
    scan::Scan,
    topics::topic,
};

/// The process that numbers the items of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum NumberedBy {
    /// The source, on `scan`.
    Source,
    /// Masking in live mode, on the topics of the other stages; otherwise they have the numbers of
    /// the source.
    Masking,
    /// A follower, whose results are numbered.
    Follower,
}

impl NumberedBy {
    const ALL: [Self; 3] = [Self::Source, Self::Masking, Self::Follower];

    /// Returns who numbers the items of a topic.
    pub fn of(name: &str) -> Self {
        match topic(name).map(|topic| topic.sender) {
            _ if name == Scan::TOPIC => Self::Source,
            Some(Sender::Stage(_)) => Self::Masking,
            _ => Self::Follower,
        }
    }

    /// The name in the file of the generations of a run.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Source => "source",
            Self::Masking => "masking",
            Self::Follower => "follower",
        }
    }

    /// Returns the process of this name.
    pub fn by_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|by| by.name() == name)
    }
}

/// A generation of numbers: it gives the numbers from `first` on again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GivenAnew {
    /// See [`Item::generation`](crate::Item::generation).
    pub generation: u32,
    /// See [`Item::numbered_from`](crate::Item::numbered_from).
    pub first: u64,
}
