//! The contract of a message type: its topic, its header, the elements of its payload and the sizes
//! of its queues. Elements are blocks of 64 bytes, so that every payload starts on a cache line and
//! is aligned for any vector unit; the transport would multiply an aligned slice of bytes.

use std::fmt::Debug;

use bytemuck::{Pod, Zeroable};

use crate::{
    item::{FollowerId, Item, StageId, flag},
    limits::{History, Limits, TopicSizes, Window},
};

/// A fixed header that starts with an [`Item`]. It is plain data, so processes may share its
/// memory.
pub trait Header: Pod + Default + Debug {
    const TYPE_NAME: &'static str;
    fn item(&self) -> &Item;
    fn item_mut(&mut self) -> &mut Item;
    /// Checks all but the item; the end of the stream has no content.
    fn check(&self, payload: &[u8], limits: &Limits) -> Result<(), String>;
}

pub trait Element: Pod + Debug {
    const TYPE_NAME: &'static str;
}

/// The process that publishes a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sender {
    /// One of these stages, whichever the run has. A run has all topics of stages.
    Stage(&'static [StageId]),
    /// A follower. Only a run that has it has its topic.
    Follower(FollowerId),
}

impl Sender {
    /// Returns the name of the process that has sent an item: the one of the stages that has
    /// stamped it, or the follower.
    pub fn of(&self, item: &Item) -> &'static str {
        let stages = match self {
            Self::Stage(stages) => *stages,
            Self::Follower(follower) => return follower.name(),
        };
        let has_stamped = |stage: &&StageId| item.hops[**stage as usize].published_ns != 0;
        let stamped = stages.iter().find(has_stamped).or(stages.first());
        stamped.map_or("", |stage| stage.name())
    }
}

pub trait Message: Sized + 'static {
    const TOPIC: &'static str;
    const SENDER: Sender;
    /// Number of processes that subscribe to the topic.
    const READERS: usize;
    const HISTORY: History;
    type Header: Header;
    /// The element that the payload is a slice of.
    type Element: Element;

    /// The same for programs that know the topic by its name alone.
    const ENTRY: &'static Topic = &Topic::of::<Self>();

    /// The longest payload, in elements. A topic without a payload still has one element.
    fn max_elements(_limits: &Limits) -> usize {
        1
    }

    /// Checks that a message keeps its contract, whatever program sent it. A receiver that has
    /// checked a message may rely on its numbers and on the length of its payload.
    fn check(
        header: &Self::Header,
        payload: &[Self::Element],
        limits: &Limits,
    ) -> Result<(), String> {
        let item = header.item();
        item.check()?;
        match item.is(flag::END) {
            true => Ok(()),
            false => header.check(bytemuck::cast_slice(payload), limits),
        }
    }

    /// Returns the bytes of the payload that the header describes; what follows them in memory has
    /// no meaning. `None`: more than a payload can have.
    fn content_bytes(_header: &Self::Header) -> Option<usize> {
        Some(0)
    }

    fn sizes(window: &Window) -> TopicSizes {
        window.queues(Self::HISTORY, Self::READERS)
    }
}

/// Implements [`Header`] for a type whose first field is `item`, and which has `check_content`.
macro_rules! header {
    ($header:ty, $type_name:literal) => {
        const _: () = assert!(std::mem::offset_of!($header, item) == 0);

        impl $crate::message::Header for $header {
            const TYPE_NAME: &'static str = $type_name;

            fn item(&self) -> &$crate::item::Item {
                &self.item
            }

            fn item_mut(&mut self) -> &mut $crate::item::Item {
                &mut self.item
            }

            fn check(&self, payload: &[u8], limits: &$crate::limits::Limits) -> Result<(), String> {
                self.check_content(payload, limits)
            }
        }
    };
}
pub(crate) use header;

/// Defines a message without a payload.
macro_rules! message {
    (
        $(#[$doc:meta])*
        $message:ident: $topic:literal, $header:ty, $sender:expr, $readers:literal readers, $history:ident
    ) => {
        $(#[$doc])*
        #[derive(Debug)]
        pub enum $message {}

        impl $crate::message::Message for $message {
            const TOPIC: &'static str = $topic;
            const SENDER: $crate::message::Sender = $sender;
            const READERS: usize = $readers;
            const HISTORY: $crate::limits::History = $crate::limits::History::$history;
            type Header = $header;
            type Element = $crate::message::FloatBlock;
        }
    };
}
pub(crate) use message;

/// 64 bytes of a polar scan.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct ByteBlock([u8; 64]);

/// 16 values of a raster.
#[repr(C, align(64))]
#[derive(Clone, Copy, Debug, Pod, Zeroable)]
pub struct FloatBlock([f32; 16]);

/// Implements an element of as many values as `LEN`.
macro_rules! block {
    ($block:ty, $len:literal, $type_name:literal) => {
        impl $block {
            pub const LEN: usize = $len;

            pub fn count(values: usize) -> usize {
                values.div_ceil(Self::LEN)
            }
        }

        impl Element for $block {
            const TYPE_NAME: &'static str = $type_name;
        }

        const _: () = assert!(size_of::<$block>() == 64 && align_of::<$block>() == 64);
    };
}

block!(ByteBlock, 64, "gyre_byte_block_v1");
block!(FloatBlock, 16, "gyre_float_block_v1");

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

/// Checks the bytes of a header and of a payload.
type Check = fn(&[u8], &[u8], &Limits) -> Result<(), String>;

#[derive(Clone, Copy, Debug)]
pub struct Topic {
    pub name: &'static str,
    pub sender: Sender,
    pub sizes: fn(&Window) -> TopicSizes,
    pub max_elements: fn(&Limits) -> usize,
    pub header: WireType,
    pub element: WireType,
    /// [`Message::check`] of the bytes of a header and of a payload.
    pub check: Check,
    /// [`Message::content_bytes`] of the bytes of a header.
    pub content_bytes: fn(&[u8]) -> Option<usize>,
}

fn check<M: Message>(header: &[u8], payload: &[u8], limits: &Limits) -> Result<(), String> {
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
