//! The contract of a message type: its topic, its header, the elements of its payload and the sizes
//! of its queues. Elements are blocks of 64 bytes, so that every payload starts on a cache line and
//! is aligned for any vector unit; the transport would multiply an aligned slice of bytes.

use std::fmt::Debug;

use bytemuck::{Pod, Zeroable};

use crate::{
    item::{FollowerId, Item, StageId, flag},
    limits::{History, Limits, TopicSizes, Window},
    wire::{Described, Structure},
};

/// A fixed header that starts with an [`Item`]. It is plain data, so processes may share its
/// memory.
pub trait Header: Described + Default + Debug {
    fn item(&self) -> &Item {
        bytemuck::from_bytes(&bytemuck::bytes_of(self)[..size_of::<Item>()])
    }

    fn item_mut(&mut self) -> &mut Item {
        bytemuck::from_bytes_mut(&mut bytemuck::bytes_of_mut(self)[..size_of::<Item>()])
    }

    /// Checks the rules beyond the bounds of single fields; the end of the stream has no content.
    fn check_content(&self, _payload: &[u8], _limits: &Limits) -> Result<(), String> {
        Ok(())
    }

    /// The longest payload, in elements. A topic without a payload still has one element.
    fn max_elements(_limits: &Limits) -> usize {
        1
    }

    /// Returns the bytes of the payload that the header describes; what follows them in memory has
    /// no meaning. `None`: more than a payload can have.
    fn content_bytes(&self) -> Option<usize> {
        Some(0)
    }

    /// Returns the message in a line for a person, without the numbers of its scan.
    fn words(&self, payload: &[u8]) -> String;
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

/// The use of a topic by observers that were not asked for particular topics.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Use {
    /// A recorder records it.
    Recorded,
    /// A link sends it.
    Linked,
    /// Messages have payloads, and a link may lose some.
    Large,
    /// Each message replaces the earlier messages, and its numbers count its parts. So a gap is no
    /// loss.
    Replaces,
}

pub trait Message: Sized + 'static {
    const TOPIC: &'static str;
    const SENDER: Sender;
    /// The processes that subscribe to the topic.
    const READERS: &'static [&'static str];
    const HISTORY: History;
    const USES: &'static [Use];
    type Header: Header;
    /// The element that the payload is a slice of.
    type Element: Element;

    /// The same for programs that know the topic by its name alone.
    const ENTRY: &'static Topic;

    /// Checks that a message keeps its contract, whatever program sent it. A receiver that has
    /// checked a message may rely on its numbers and on the length of its payload.
    fn check(
        header: &Self::Header,
        payload: &[Self::Element],
        limits: &Limits,
    ) -> Result<(), String> {
        let item = header.item();
        item.check(limits)?;
        if item.is(flag::END) {
            return Ok(());
        }
        Self::Header::STRUCTURE.check(bytemuck::bytes_of(header), limits)?;
        header.check_content(bytemuck::cast_slice(payload), limits)
    }

    fn sizes(window: &Window) -> TopicSizes {
        window.queues(Self::HISTORY, Self::READERS.len())
    }
}

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
    pub doc: &'static [&'static str],
    pub sender: Sender,
    pub readers: &'static [&'static str],
    pub uses: &'static [Use],
    pub sizes: fn(&Window) -> TopicSizes,
    pub max_elements: fn(&Limits) -> usize,
    pub structure: &'static Structure,
    pub header: WireType,
    pub element: WireType,
    /// [`Message::check`] of the bytes of a header and of a payload.
    pub check: Check,
    /// [`Header::content_bytes`] of the bytes of a header.
    pub content_bytes: fn(&[u8]) -> Option<usize>,
    /// [`Header::words`] of the bytes of a header and of a payload.
    pub words: fn(&[u8], &[u8]) -> String,
}

fn check<M: Message>(header: &[u8], payload: &[u8], limits: &Limits) -> Result<(), String> {
    let payload = bytemuck::cast_slice(payload);
    M::check(bytemuck::from_bytes(header), payload, limits)
}

impl Topic {
    pub(crate) const fn of<M: Message>(doc: &'static [&'static str]) -> Self {
        Self {
            name: M::TOPIC,
            doc,
            sender: M::SENDER,
            readers: M::READERS,
            uses: M::USES,
            sizes: M::sizes,
            max_elements: M::Header::max_elements,
            structure: &M::Header::STRUCTURE,
            header: WireType::of::<M::Header>(M::Header::STRUCTURE.type_name),
            element: WireType::of::<M::Element>(M::Element::TYPE_NAME),
            check: check::<M>,
            content_bytes: |header| bytemuck::from_bytes::<M::Header>(header).content_bytes(),
            words: |header, payload| bytemuck::from_bytes::<M::Header>(header).words(payload),
        }
    }

    pub fn is(&self, used: Use) -> bool {
        self.uses.contains(&used)
    }
}
