//! The numbers of items that are given again.

use crate::{
    message::{Message, Sender},
    scan::Scan,
    topics::topic,
};

crate::named! {
    /// The process that numbers the items of a topic; its name is in the file of the generations.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
    pub enum NumberedBy {
        /// The source, on `scan`.
        Source = "source",
        /// Masking in live mode, on the topics of the other stages; otherwise they have the numbers
        /// of the source.
        Masking = "masking",
        /// A follower, whose results are numbered.
        Follower = "follower",
    }
}

impl NumberedBy {
    /// Returns who numbers the items of a topic.
    pub fn of(name: &str) -> Self {
        match topic(name).map(|topic| topic.sender) {
            _ if name == Scan::TOPIC => Self::Source,
            Some(Sender::Stage(_)) => Self::Masking,
            _ => Self::Follower,
        }
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
