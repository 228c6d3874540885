//! One item at a time, while observers come and go and one never reads; then SIGTERM in the middle. The results must be those of the
//! whole stream.

use super::{
    Examination, compare, how,
    stream::{starts, stops},
};
use crate::{
    ConformanceError,
    rule::Rule,
    session::{Pace, Session, Waited},
};

/// Items between two observers.
const BETWEEN: u64 = 3;

impl Examination<'_> {
    pub(super) fn steps(&mut self) -> Result<(), ConformanceError> {
        let rig = self.subject.rig(self.signals, "steps")?;
        let mut session = Session::open(self.subject, &rig, self.tape, &mut self.findings)?;
        session.pace = Pace::Single;
        if !starts(&mut session)? {
            return Ok(());
        }
        session.connect_all()?;
        let never_read = rig.tap(session.ports.output)?;
        let patience = self.subject.demands.patience;
        session.findings.checked(Rule::IgnoresObservers);
        for seq in 0..self.tape.end() * 2 / 3 {
            let waited = session.wait(patience, |session| session.newest() >= Some(seq))?;
            if !matches!(waited, Waited::Done) {
                let sentence = format!(
                    "while observers came and went it sent nothing about item {seq}: {}",
                    how(&waited)
                );
                session.findings.broken(Rule::IgnoresObservers, sentence);
                break;
            }
            if seq % BETWEEN == 0 {
                // It takes what is there, if anything, and leaves.
                drop(rig.tap(session.ports.output)?.receive());
            }
        }
        // Items are on their way when the request comes.
        session.pace = Pace::Window;
        session.send_history()?;
        stops(&mut session, "in the middle of the stream")?;
        drop(never_read);
        let all = 0..session.outputs.len();
        let when = "when the items come one at a time";
        compare(
            &mut session,
            &self.reference,
            all,
            Rule::Deterministic,
            when,
        )
    }
}
