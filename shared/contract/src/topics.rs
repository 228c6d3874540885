//! All topics, the shared memory that they need, and who numbers their items.

use std::fmt;

use serde::Serialize;

use crate::{
    follower::{CorrectionHeader, FixHeader, LoopHeader},
    gnss::GnssHeader,
    intake::IntakeHeader,
    item::{FollowerId, StageId},
    limits::{History, Limits, TopicSizes, Window},
    masked::MaskedHeader,
    message::{ByteBlock, FloatBlock, Message, Sender, Topic, Use},
    motion::{MotionHeader, RotationHeader},
    object::ObjectsHeader,
    pose::PoseHeader,
    predicted_pose::PredictedPoseHeader,
    scan::ScanHeader,
};

/// Bytes that the transport puts before each sample, rounded up.
const SAMPLE_OVERHEAD: usize = 192;

const PAGE: usize = 4096;
/// Pages of bookkeeping, whatever the topics.
const OTHER_PAGES: usize = 32;
const PAGES_PER_TOPIC: usize = 8;
const PAGES_PER_SUBSCRIBER: usize = 4;

/// Defines the messages, in the order of the stream: header and element of the payload, sender,
/// readers, how far its history reaches, and what observers do with it ([`Use`]). The history
/// `Stream` is one window of scans, `Feedback` two, `Latest` the last messages. Queues follow from
/// history and readers; `sizes` changes them. The module of a header describes its fields.
macro_rules! topics {
    ($(
        $(#[doc = $doc:literal])+
        $Message:ident = $topic:literal {
            $Header:ty, $Element:ty, by $sender:expr, for $readers:expr, $history:ident,
            is [$($used:ident)*]
            $(, sizes: $sizes:expr)?
        }
    )*) => {
        $(
            $(#[doc = $doc])+
            #[derive(Debug)]
            pub enum $Message {}

            const _: () = assert!(std::mem::offset_of!($Header, item) == 0);

            impl Message for $Message {
                const TOPIC: &'static str = $topic;
                const SENDER: Sender = $sender;
                const READERS: &'static [&'static str] = &$readers;
                const HISTORY: History = History::$history;
                const USES: &'static [Use] = &[$(Use::$used),*];
                type Header = $Header;
                type Element = $Element;
                const ENTRY: &'static Topic = &Topic::of::<Self>(&[$($doc),+]);

                $(fn sizes(window: &Window) -> TopicSizes {
                    let sizes: fn(&Window, TopicSizes) -> TopicSizes = $sizes;
                    sizes(window, window.queues(Self::HISTORY, Self::READERS.len()))
                })?
            }
        )*

        /// All topics, in the order of the stream.
        const TOPICS: &[&Topic] = &[$($Message::ENTRY),*];
    };
}

topics! {
    /// A polar scan as measured, with samples of other sensors. Payload: the image as decoded,
    /// then the samples.
    Scan = "scan" {
        ScanHeader, ByteBlock, by Sender::Stage(&[StageId::RadarReplay]), for ["masking"], Stream,
        is [Recorded Large],
        // In live mode the history holds the scans that are published while masking restarts.
        sizes: |window, sizes| {
            let depth = window.live_depth.max(sizes.history);
            let borrowed = depth + window.look_back;
            match window.live_depth {
                0 => sizes,
                _ => TopicSizes { history: depth, buffer: depth, borrowed, ..sizes },
            }
        }
    }
    /// Counts of delivered and lost data of a live radar, with each scan.
    Intake = "intake" {
        IntakeHeader, FloatBlock, by Sender::Stage(&[StageId::RadarReplay]), for [], Latest,
        is [Recorded Linked Replaces]
    }
    /// The fixes of a live GNSS receiver. The trajectory logs them; odometry does not use them.
    Gnss = "gnss" {
        GnssHeader, FloatBlock, by Sender::Stage(&[StageId::RadarReplay]), for ["trajectory"],
        Latest, is [],
        // Ten seconds of 20 fixes: a trajectory that is restarted, or busy, loses none.
        sizes: |window, sizes| match window.slam {
            true => TopicSizes { history: 200, buffer: 200, ..sizes },
            false => sizes,
        }
    }
    /// Masked rasters and sparse points, and what other sensors have measured. Payload:
    /// one raster if the mask takes one scan, or two (this scan and the previous one, both masked
    /// for this pair) if it takes both; then the scan's points. Each part starts at a whole block.
    Masked = "masked" {
        MaskedHeader, FloatBlock, by Sender::Stage(&[StageId::Masking]),
        for ["rotation-search", "translation-search", "refinement"], Stream,
        is [Large],
        // In a run with SLAM pose-integration reads the points of keyframes.
        sizes: |window, sizes| TopicSizes {
            readers: sizes.readers + usize::from(window.logs_points()),
            ..sizes
        }
    }
    /// The rotation from the previous scan to this one.
    Rotation = "rotation" {
        RotationHeader, FloatBlock, by Sender::Stage(&[StageId::RotationSearch]),
        for ["translation-search"], Stream, is []
    }
    /// The motion from the previous scan to this one.
    Motion = "motion" {
        MotionHeader, FloatBlock,
        by Sender::Stage(&[StageId::TranslationSearch, StageId::JointSearch]),
        for ["refinement or pose-integration", "masking"], Feedback,
        is [Recorded Linked]
    }
    /// As `motion`, in runs with refinement. The searched motion stays beside the refined one.
    Refined = "refined" {
        MotionHeader, FloatBlock, by Sender::Stage(&[StageId::Refinement]),
        for ["pose-integration"], Feedback, is [Recorded Linked]
    }
    /// The newest pose of the trajectory. Pose `seq` is the credit that admits scan `seq + W`.
    Pose = "pose" {
        PoseHeader, FloatBlock, by Sender::Stage(&[StageId::PoseIntegration]),
        for ["radar-replay", "masking", "supervisor"], Feedback,
        is [Recorded Linked]
    }
    /// The pose between scans: predicted from the last pose to the time when it is published, in a
    /// run of a live radar with `run.predict_hz`.
    PredictedPose = "predicted_pose" {
        PredictedPoseHeader, FloatBlock, by Sender::Stage(&[StageId::RadarReplay]), for [], Latest,
        is []
    }
    /// An accepted loop between two keyframes.
    Loop = "loop" {
        LoopHeader, FloatBlock, by Sender::Follower(FollowerId::LoopClosure), for [], Latest,
        is [Recorded Linked]
    }
    /// The transform that corrects poses of the odometry. Odometry is continuous and drifts; the
    /// correction jumps when a loop is closed (REP-105: the transform from `map` to `odom`).
    Correction = "correction" {
        CorrectionHeader, FloatBlock, by Sender::Follower(FollowerId::Trajectory), for [], Latest,
        is [Recorded Linked Replaces]
    }
    /// The place of a keyframe in the map of an earlier drive.
    Fix = "fix" {
        FixHeader, FloatBlock, by Sender::Follower(FollowerId::Localisation), for [], Latest,
        is [Recorded Linked]
    }
    /// Moving objects.
    Objects = "objects" {
        ObjectsHeader, FloatBlock, by Sender::Follower(FollowerId::Objects), for [], Latest,
        is [Recorded]
    }
}

/// Returns all topics, in the order of the stream.
pub fn all() -> impl Iterator<Item = &'static Topic> {
    TOPICS.iter().copied()
}

/// Returns the topics of a run, in the order of the stream.
pub fn topics(window: &Window) -> impl Iterator<Item = &'static Topic> + use<> {
    let window = *window;
    TOPICS
        .iter()
        .copied()
        .filter(move |topic| match topic.sender {
            Sender::Stage(_) => true,
            Sender::Follower(follower) => follower.is_in(&window),
        })
}

pub fn topic(name: &str) -> Option<&'static Topic> {
    all().find(|topic| topic.name == name)
}

/// Returns the topic of this name, or a sentence that names those that there are.
pub fn named(name: &str) -> Result<&'static Topic, String> {
    let known = || all().map(|topic| topic.name).collect::<Vec<_>>().join(", ");
    topic(name).ok_or_else(|| format!("there is no topic `{name}`: there are {}", known()))
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

gyre_geometry::named! {
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
            Some(Sender::Stage([StageId::RadarReplay])) => Self::Source,
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
        assert_eq!(names(&WINDOW).last(), Some(&"predicted_pose"));
        assert_eq!(names(&slam)[9..], ["loop", "correction"]);
        let with_map = Window {
            localises: true,
            ..slam
        };
        assert_eq!(names(&with_map)[9..], ["loop", "correction", "fix"]);
        assert_eq!(names(&with_objects)[9..], ["objects"]);
        assert_eq!(Masked::sizes(&with_objects), Masked::sizes(&slam));
        let added = Masked::sizes(&slam).samples() - Masked::sizes(&WINDOW).samples();
        assert_eq!(added, 3);
    }
}
