//! All topics, the shared memory that they need, and who numbers their items.

use std::fmt;

use serde::Serialize;

use crate::{
    follower::{Correction, Fix, Loop, Objects},
    limits::{Limits, Window},
    masked::Masked,
    message::{Message, Sender, Topic},
    motion::{Motion, Refined, Rotation},
    pose::Pose,
    scan::Scan,
};

/// Bytes that the transport puts before each sample, rounded up.
const SAMPLE_OVERHEAD: usize = 192;

const PAGE: usize = 4096;
/// Pages of bookkeeping, whatever the topics.
const OTHER_PAGES: usize = 32;
const PAGES_PER_TOPIC: usize = 8;
const PAGES_PER_SUBSCRIBER: usize = 4;

const TOPICS: [Topic; 10] = [
    Topic::of::<Scan>(),
    Topic::of::<Masked>(),
    Topic::of::<Rotation>(),
    Topic::of::<Motion>(),
    Topic::of::<Refined>(),
    Topic::of::<Pose>(),
    Topic::of::<Loop>(),
    Topic::of::<Correction>(),
    Topic::of::<Fix>(),
    Topic::of::<Objects>(),
];

/// Returns the topics of a run, in the order of the stream.
pub fn topics(window: &Window) -> impl Iterator<Item = &'static Topic> + use<> {
    let window = *window;
    TOPICS.iter().filter(move |topic| match topic.sender {
        Sender::Stage(_) => true,
        Sender::Follower(follower) => follower.is_in(&window),
    })
}

pub fn topic(name: &str) -> Option<&'static Topic> {
    TOPICS.iter().find(|topic| topic.name == name)
}

/// Returns an upper limit of the transport's bookkeeping, with whole pages for each file: a service
/// has its description and state, a subscriber its queue, its events, and a process of its own.
/// Measured without observers: 83 pages.
fn bookkeeping(window: &Window) -> usize {
    let subscribers: usize = topics(window)
        .map(|topic| (topic.sizes)(window).subscribers())
        .sum();
    (OTHER_PAGES + topics(window).count() * PAGES_PER_TOPIC + subscribers * PAGES_PER_SUBSCRIBER)
        * PAGE
}

/// The shared memory that a run needs, bytes.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Footprint {
    /// Of each topic's segment, by topic, and of the transport's bookkeeping.
    pub segments: Vec<(&'static str, usize)>,
}

impl Footprint {
    pub fn new(window: &Window, limits: &Limits) -> Self {
        let segments = topics(window).map(|topic| {
            let samples = (topic.sizes)(window).samples();
            let payload = (topic.max_elements)(limits) * topic.element.bytes;
            let sample = SAMPLE_OVERHEAD + topic.header.bytes + payload;
            (topic.name, samples * sample)
        });
        let bookkeeping = [("bookkeeping", bookkeeping(window))];
        Self {
            segments: segments.chain(bookkeeping).collect(),
        }
    }

    pub fn total(&self) -> usize {
        self.segments.iter().map(|(_, bytes)| bytes).sum()
    }
}

impl fmt::Display for Footprint {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let total_mb = self.total() as f64 / 1e6;
        write!(f, "{total_mb:.1} MB of shared memory (")?;
        for (i, (topic, bytes)) in self.segments.iter().enumerate() {
            let separator = if i == 0 { "" } else { ", " };
            write!(f, "{separator}{topic} {:.1}", *bytes as f64 / 1e6)?;
        }
        write!(f, ")")
    }
}

crate::named! {
    /// The process that numbers the items of a topic; its name is in the file of the generations.
    #[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
    pub enum NumberedBy {
        Source = "source",
        /// Masking in live mode, on the topics of the other stages; otherwise they have the numbers
        /// of the source.
        Masking = "masking",
        Follower = "follower",
    }
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

/// A generation of numbers: it gives the numbers from `first` on again.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct GivenAnew {
    pub generation: u32,
    pub first: u64,
}

#[cfg(test)]
mod tests {
    use super::*;

    const WINDOW: Window = Window {
        scans: 4,
        lag: 2,
        look_back: 1,
        live_depth: 0,
        observers: 8,
        slam: false,
        localises: false,
        objects: false,
    };

    #[test]
    fn queues_hold_the_history_and_one_window_more() {
        let scan = Scan::sizes(&WINDOW);
        assert_eq!((scan.history, scan.buffer, scan.samples()), (5, 9, 21));
        assert_eq!(Masked::sizes(&WINDOW).samples(), 27);
        let pose = Pose::sizes(&WINDOW);
        assert_eq!((pose.history, pose.buffer), (12, 16));
    }

    #[test]
    fn a_run_has_the_topics_of_its_followers_and_their_memory() {
        let names = |window| topics(window).map(|topic| topic.name).collect::<Vec<_>>();
        let (mut slam, mut with_objects) = (WINDOW, WINDOW);
        (slam.slam, with_objects.objects) = (true, true);
        assert_eq!(names(&WINDOW).last(), Some(&"pose"));
        assert_eq!(names(&slam)[6..], ["loop", "correction"]);
        let with_map = Window {
            localises: true,
            ..slam
        };
        assert_eq!(names(&with_map)[6..], ["loop", "correction", "fix"]);
        assert_eq!(names(&with_objects)[6..], ["objects"]);
        assert_eq!(Masked::sizes(&with_objects), Masked::sizes(&slam));
        let added = Masked::sizes(&slam).samples() - Masked::sizes(&WINDOW).samples();
        assert_eq!(added, 3);
    }
}
