//! `refined`: the motion between two scans after refinement.

use crate::{
    block::FloatBlock,
    check::Violation,
    item::StageId,
    limits::{History, Limits},
    message::{Message, Sender},
    motion::MotionHeader,
};

/// As [`Motion`](crate::Motion), in runs with refinement. The searched motion stays beside the
/// refined one.
#[derive(Debug)]
pub enum Refined {}

impl Message for Refined {
    const TOPIC: &'static str = "refined";
    const SENDER: Sender = Sender::Stage(&[StageId::Refinement]);
    const READERS: usize = 1;
    const HISTORY: History = History::Feedback;
    type Header = MotionHeader;
    type Element = FloatBlock;

    fn check_content(
        header: &Self::Header,
        _: &[Self::Element],
        limits: &Limits,
    ) -> Result<(), Violation> {
        header.motion.check(limits)
    }
}
