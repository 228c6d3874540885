//! Wire types: the messages that Gyre's processes exchange, their versions and limits.
//!
//! Each message is a fixed header and a slice of 64-byte aligned elements, on a topic of its own:
//!
//! | topic | header | payload |
//! |---|---|---|
//! | `scan` | [`ScanHeader`] | the sweep's bytes, in [`ByteBlock`]s |
//! | `masked` | [`MaskedHeader`] | one or two rasters and the scan's points, in [`FloatBlock`]s |
//! | `rotation` | [`RotationHeader`] | empty (later: the polar spectrum) |
//! | `motion` | [`MotionHeader`] | empty |
//! | `refined` | [`MotionHeader`] | empty |
//! | `pose` | [`PoseHeader`] | empty |
//!
//! All of them start with an [`Item`]: which scan this is, which one it follows, and when each process worked on it.
//! A type's name carries its version, so that two builds that disagree refuse each other instead of misreading.

// Sharing a type between processes is a claim that the compiler cannot check; each `unsafe impl` here says why it holds.
#![allow(unsafe_code)]

mod block;
mod item;
mod limits;
mod masked;
mod motion;
mod pose;
mod refined;
mod rotation;
mod scan;
mod topic;

pub use block::{ByteBlock, FloatBlock};
pub use item::{Hop, Hops, Item, StageId, flag};
pub use limits::{Footprint, Limits, MAX_NODES, TopicSizes, Window, WindowError};
pub use masked::{Masked, MaskedHeader, MaskedParts, Pair, mask_kind};
pub use motion::{Motion, MotionEstimate, MotionHeader, SearchedMotion};
pub use pose::{Pose, PoseHeader};
pub use refined::{Refined, RefinementRecord, initial_guess, outcome};
pub use rotation::{Rotation, RotationEstimate, RotationHeader};
pub use scan::{Scan, ScanHeader};
pub use topic::{Header, History, Message, TOPICS, Topic};
