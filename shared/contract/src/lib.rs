//! Wire types: the messages that Gyre's processes exchange, their versions and limits.
//!
//! Each message is a fixed header, which starts with an [`Item`], and a slice of 64-byte aligned
//! elements, on a topic of its own: see [`topics()`]. Type names carry a version, so that builds of
//! different versions reject each other's messages instead of misreading them.

mod basis;
mod check;
pub mod control;
mod follower;
mod item;
mod limits;
mod masked;
mod message;
mod motion;
mod named;
mod pose;
mod refinement;
pub mod run;
mod sample_rates;
mod scan;
mod topics;

pub use basis::{Basis, WitnessCounts};
pub use follower::{
    Correction, CorrectionHeader, Fix, FixHeader, ListedObject, Loop, LoopHeader, MAX_LISTED,
    Objects, ObjectsHeader, fix_status,
};
pub use item::{FollowerId, Hop, HopTimes, Hops, Item, StageId, flag};
pub use limits::{History, Limits, TopicSizes, Window};
pub use masked::{Masked, MaskedHeader, MaskedParts, Pair, mask_kind};
pub use message::{ByteBlock, Element, FloatBlock, Header, Message, Sender, Topic, WireType};
pub use motion::{
    Motion, MotionEstimate, MotionHeader, Refined, Rotation, RotationEstimate, RotationHeader,
};
pub use pose::{Pose, PoseHeader, compose};
pub use refinement::{RefinementRecord, doppler, gyro, initial_guess, outcome, wheels};
pub use sample_rates::{SampleHealth, SampleRates};
pub use scan::{Scan, ScanHeader};
pub use topics::{Footprint, GivenAnew, NumberedBy, topic, topics};
