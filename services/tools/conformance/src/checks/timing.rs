//! How long the program takes by the clock of this one: one item at a time, from when it is sent to when its answer is read. The stamps in
//! the answers are the program's own word.

use super::{Examination, how, stream::starts};
use crate::{
    ConformanceError,
    report::Work,
    rule::Rule,
    session::{Pace, Session, Waited},
};

impl Examination<'_> {
    /// Measures the answers to all items. A source answers none: it is asked for the next by a pose.
    pub(super) fn timing(&mut self) -> Result<Option<Work>, ConformanceError> {
        let rig = self.subject.rig(self.signals, "timing")?;
        let mut session = Session::open(self.subject, &rig, self.tape, &mut self.findings)?;
        if session.ports.copied().is_none() {
            return Ok(None);
        }
        session.pace = Pace::Single;
        if !starts(&mut session)? {
            return Ok(None);
        }
        session.connect_all()?;
        let (patience, end) = (self.subject.demands.patience, self.tape.end());
        let waited = session.wait(patience, |session| session.newest() >= Some(end))?;
        let has_ended = matches!(waited, Waited::Done);
        session.findings.require(Rule::KeepsBudget, has_ended, || {
            let how = how(&waited);
            format!("it has not come to the end when the items come one at a time: {how}")
        });
        Ok(Work::of((0..end).filter_map(|seq| session.answer_ns(seq))))
    }
}
