//! Wire types: the messages that Gyre's processes exchange, their versions and limits.
//!
//! Each message is a fixed header, which starts with an [`Item`], and a slice of 64-byte aligned
//! elements, on a topic of its own: see [`topics()`]. Type names carry a version, so that builds of
//! different versions reject each other's messages instead of misreading them.

mod basis;
mod command;
pub mod control;
mod follower;
mod gnss;
mod intake;
mod item;
pub mod layout;
mod limits;
mod masked;
mod message;
mod motion;
mod object;
mod pose;
mod predicted_pose;
mod refinement;
pub mod run;
mod sample_rates;
mod scan;
mod stages;
mod topics;
pub mod wire;

pub use basis::{Basis, WitnessCounts};
pub use command::{Command, CommandError, Commands, CommandsOfScans, GivenPose};
pub use follower::{CorrectionHeader, FixHeader, LoopHeader, fix_status};
pub use gnss::GnssHeader;
pub use gyre_geometry::{
    named,
    samples::{Measures, Witness},
};
pub use intake::IntakeHeader;
pub use item::{FollowerId, Hop, HopTimes, Hops, Item, StageId, flag};
pub use limits::{History, Limits, TopicSizes, Window};
pub use masked::{MaskedHeader, MaskedParts, Pair, mask_kind};
pub use message::{ByteBlock, Element, FloatBlock, Header, Message, Sender, Topic, Use, WireType};
pub use motion::{MotionEstimate, MotionHeader, RotationEstimate, RotationHeader};
pub use object::{Drawing, MAX_LISTED, Object, ObjectsHeader};
pub use pose::{PoseHeader, compose};
pub use predicted_pose::PredictedPoseHeader;
pub use refinement::{RefinementRecord, WitnessRecord, initial_guess, outcome, verdict};
pub use sample_rates::{SampleHealth, SampleRates};
pub use scan::ScanHeader;
pub use stages::{StageTopics, composed};
pub use topics::{
    Correction, Fix, Footprint, GivenAnew, Gnss, Intake, Loop, Masked, Motion, NumberedBy, Objects,
    Pose, PredictedPose, Refined, Rotation, Scan, all, named as topic_named, topic, topics,
};
