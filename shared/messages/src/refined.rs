//! `refined`: the motion between two scans after refinement.

use crate::{block::FloatBlock, limits::History, message::Message, motion::MotionHeader};

/// As [`Motion`](crate::Motion), in runs with refinement. The searched motion stays beside the refined one.
#[derive(Debug)]
pub enum Refined {}

impl Message for Refined {
    const TOPIC: &'static str = "refined";
    const READERS: usize = 1;
    const HISTORY: History = History::Feedback;
    type Header = MotionHeader;
    type Element = FloatBlock;
}
