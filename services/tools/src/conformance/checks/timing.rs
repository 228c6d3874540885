//! The time of its answers by the clock of this process: one item at a time, from when it is sent
//! to when its answer is read. The stamps in the answers are the program's own.

use super::{Examination, stream::starts};
use crate::conformance::{
    ProgramError,
    report::Work,
    rule::Rule,
    session::{Pace, Session},
};

impl Examination<'_> {
    /// Measures the answers to all items. A source answers none: it is asked for the next by a
    /// pose.
    pub(super) fn timing(&mut self) -> Result<Option<Work>, ProgramError> {
        let mut session = Session::open(self.context, "timing", &mut self.findings)?;
        if session.harness.topics.copied().is_none() {
            return Ok(None);
        }
        session.pace = Pace::Single;
        if !starts(&mut session)? {
            return Ok(None);
        }
        session.harness.connect()?;
        let end = self.context.reference.end();
        let waited = session.reach(end)?;
        session
            .findings
            .require(Rule::KeepsBudget, waited.is_done(), || {
                format!("it has not come to the end when the items come one at a time: {waited}")
            });
        Ok(Work::of((0..end).filter_map(|seq| session.answer_ns(seq))))
    }
}
