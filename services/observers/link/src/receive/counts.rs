//! The counts of a receiver.

use std::{collections::BTreeMap, fmt};

use crate::send::is_lossless;

#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Received {
    pub topics: BTreeMap<String, ReceivedCount>,
    /// True if it ended on a request to stop, before the run.
    pub is_interrupted: bool,
}

#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct ReceivedCount {
    pub received: u64,
    pub missed: u64,
}

impl Received {
    pub fn is_complete(&self) -> bool {
        let mut topics = self.topics.iter();
        topics.all(|(topic, count)| !is_lossless(topic) || count.missed == 0)
    }
}

impl fmt::Display for Received {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let list = |number: fn(&ReceivedCount) -> u64| {
            let topics = self.topics.iter().filter(|it| number(it.1) > 0);
            let topics = topics.map(|(topic, count)| format!("{} {topic}", number(count)));
            match &topics.collect::<Vec<String>>()[..] {
                [] => "nothing".to_owned(),
                topics => topics.join(", "),
            }
        };
        let (received, missed) = (list(|it| it.received), list(|it| it.missed));
        write!(f, "received {received}; missed {missed}")
    }
}
