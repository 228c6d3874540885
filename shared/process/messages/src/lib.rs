//! Wire types: the messages that Gyre's processes exchange, their versions and limits.
//!
//! Each message is a fixed header, which starts with an [`Item`], and a slice of 64-byte aligned
//! elements, on a topic of its own: see [`topics()`]. Type names carry a version, so that two builds
//! of different versions reject each other's messages instead of misreading them.
//!
//! Reading order: `item`, `limits`, `message` (the contract of a message type), `check` (its
//! enforcement), one file per message, `topics`.

mod basis;
mod block;
mod check;
mod closed_loop;
mod compose;
mod correction;
mod fix;
mod follower;
mod item;
mod limits;
mod masked;
mod message;
mod motion;
mod named;
mod numbering;
mod objects;
mod pose;
mod refined;
mod refinement;
mod rotation;
mod sample_rates;
mod scan;
mod topics;

pub use basis::{Basis, WitnessCounts};
pub use block::{ByteBlock, FloatBlock};
pub use check::Violation;
pub use closed_loop::{Loop, LoopHeader};
pub use compose::compose;
pub use correction::{Correction, CorrectionHeader};
pub use fix::{Fix, FixHeader, fix_status};
pub use follower::FollowerId;
pub use item::{Hop, HopTimes, Hops, Item, StageId, flag};
pub use limits::{History, Limits, TopicSizes, Window};
pub use masked::{Masked, MaskedHeader, MaskedParts, Pair, mask_kind};
pub use message::{Element, Header, Message, Sender};
pub use motion::{Motion, MotionEstimate, MotionHeader};
pub use numbering::{GivenAnew, NumberedBy};
pub use objects::{ListedObject, MAX_LISTED, Objects, ObjectsHeader};
pub use pose::{Pose, PoseHeader};
pub use refined::Refined;
pub use refinement::{RefinementRecord, doppler, gyro, initial_guess, outcome, wheels};
pub use rotation::{Rotation, RotationEstimate, RotationHeader};
pub use sample_rates::{SampleHealth, SampleRates};
pub use scan::{Scan, ScanHeader};
pub use topics::{Footprint, Topic, WireType, topic, topics};
