//! All topics, the shared memory that they need, and who numbers their items.

use std::fmt;

use serde::Serialize;

use crate::{
    check::Violation,
    follower::{Correction, Fix, Loop, Objects},
    limits::{Limits, TopicSizes, Window},
    masked::Masked,
    message::{Element, Header, Message, Sender},
    motion::{Motion, Refined, Rotation},
    pose::Pose,
    scan::Scan,
};

/// Bytes that the transport puts before each sample, rounded up.
const SAMPLE_OVERHEAD: usize = 192;

/// A type of headers or of elements, as the transport compares it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct WireType {
    pub name: &'static str,
    pub bytes: usize,
    pub alignment: usize,
}

impl WireType {
    const fn of<T>(name: &'static str) -> Self {
        Self {
            name,
            bytes: size_of::<T>(),
            alignment: align_of::<T>(),
        }
    }
}

#[derive(Clone, Copy, Debug)]
pub struct Topic {
    pub name: &'static str,
    pub sender: Sender,
    pub sizes: fn(&Window) -> TopicSizes,
    pub max_elements: fn(&Limits) -> usize,
    pub header: WireType,
    pub element: WireType,
    /// [`Message::check`] of the bytes of a header and of a payload.
    pub check: fn(&[u8], &[u8], &Limits) -> Result<(), Violation>,
    /// [`Message::content_bytes`] of the bytes of a header.
    pub content_bytes: fn(&[u8]) -> Option<usize>,
}

fn check<M: Message>(header: &[u8], payload: &[u8], limits: &Limits) -> Result<(), Violation> {
    let payload = bytemuck::cast_slice(payload);
    M::check(bytemuck::from_bytes(header), payload, limits)
}

fn content_bytes<M: Message>(header: &[u8]) -> Option<usize> {
    M::content_bytes(bytemuck::from_bytes(header))
}

impl Topic {
    pub const fn of<M: Message>() -> Self {
        Self {
            name: M::TOPIC,
            sender: M::SENDER,
            sizes: M::sizes,
            max_elements: M::max_elements,
            header: WireType::of::<M::Header>(M::Header::TYPE_NAME),
            element: WireType::of::<M::Element>(M::Element::TYPE_NAME),
            check: check::<M>,
            content_bytes: content_bytes::<M>,
        }
    }
}

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
