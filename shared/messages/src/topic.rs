//! Topics: what makes a type a message, and how large its queues and payloads are.

use std::fmt::Debug;

use bytemuck::Pod;
use iceoryx2::prelude::ZeroCopySend;

use crate::{
    Limits, Masked, Motion, Pose, Refined, Rotation, Scan, TopicSizes, Window, item::Item,
};

/// Bytes that the transport puts before each sample, rounded up.
const SAMPLE_OVERHEAD: usize = 192;

/// A fixed header that starts with an [`Item`].
pub trait Header: ZeroCopySend + Default + Debug + 'static {
    /// Which scan this is about.
    fn item(&self) -> &Item;
    /// Which scan this is about, to fill in.
    fn item_mut(&mut self) -> &mut Item;
}

/// How far back a publisher's history must reach for a reader that is restarted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum History {
    /// Along the stream: the window, and what the work on a scan looks back at.
    Stream,
    /// Back to earlier stages: another window and the lag of motion compensation more.
    Feedback,
}

/// A topic's contract: its name, its readers, its header and its payload's elements.
pub trait Message: 'static {
    /// The topic's name.
    const TOPIC: &'static str;
    /// Stages that read it.
    const READERS: usize;
    /// How far back the publisher's history reaches.
    const HISTORY: History;
    /// What comes with each message.
    type Header: Header;
    /// What the payload is a slice of.
    type Element: ZeroCopySend + Pod + Debug;

    /// The longest payload, in elements. A topic without a payload has one element all the same.
    fn max_elements(_limits: &Limits) -> usize {
        1
    }

    /// The sizes of the topic's queues.
    fn sizes(window: &Window) -> TopicSizes {
        window.queues(Self::HISTORY, Self::READERS)
    }
}

/// What a program that treats all topics alike must know of one.
#[derive(Clone, Copy, Debug)]
pub struct Topic {
    /// The topic's name.
    pub name: &'static str,
    /// The sizes of its queues.
    pub sizes: fn(&Window) -> TopicSizes,
    /// Bytes of its largest sample in shared memory.
    pub max_sample_bytes: fn(&Limits) -> usize,
}

impl Topic {
    const fn of<M: Message>() -> Self {
        Self {
            name: M::TOPIC,
            sizes: M::sizes,
            max_sample_bytes: max_sample_bytes::<M>,
        }
    }
}

/// All topics, in the order of the stream.
pub const TOPICS: [Topic; 6] = [
    Topic::of::<Scan>(),
    Topic::of::<Masked>(),
    Topic::of::<Rotation>(),
    Topic::of::<Motion>(),
    Topic::of::<Refined>(),
    Topic::of::<Pose>(),
];

fn max_sample_bytes<M: Message>(limits: &Limits) -> usize {
    SAMPLE_OVERHEAD + size_of::<M::Header>() + M::max_elements(limits) * size_of::<M::Element>()
}

/// Gives a header its item.
macro_rules! header {
    ($header:ty) => {
        impl $crate::Header for $header {
            fn item(&self) -> &$crate::Item {
                &self.item
            }
            fn item_mut(&mut self) -> &mut $crate::Item {
                &mut self.item
            }
        }
    };
}
pub(crate) use header;
