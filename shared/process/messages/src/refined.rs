//! `refined`: the motion between two scans after refinement.

use crate::{
    item::StageId,
    message::{Sender, message},
    motion::MotionHeader,
};

message! {
    /// As [`Motion`](crate::Motion), in runs with refinement. The searched motion stays beside the
    /// refined one.
    Refined: "refined", MotionHeader, Sender::Stage(&[StageId::Refinement]), 1 readers, Feedback
}
