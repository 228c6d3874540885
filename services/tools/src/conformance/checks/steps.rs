//! One item at a time, while observers come and go and one never reads; then SIGTERM in the middle.
//! The results must equal the results of the whole stream.

use super::{
    Examination,
    stream::{starts, stops},
};
use crate::conformance::{
    ProgramError,
    rule::Rule,
    session::{Pace, Session},
};

/// Items between two observers.
const BETWEEN: u64 = 3;

impl Examination<'_> {
    pub(super) fn steps(&mut self) -> Result<(), ProgramError> {
        let mut session = Session::open(self.context, "steps", &mut self.findings)?;
        session.pace = Pace::Single;
        if !starts(&mut session)? {
            return Ok(());
        }
        session.harness.connect()?;
        let output = session.output_topic();
        let never_read = session.harness.rig.tap(output)?;
        session.findings.checked(Rule::IgnoresObservers);
        for seq in 0..self.context.reference.end() * 2 / 3 {
            let waited = session.reach(seq)?;
            if !waited.is_done() {
                let sentence = format!(
                    "while observers came and went it sent nothing about item {seq}: {waited}"
                );
                session.findings.broken(Rule::IgnoresObservers, sentence);
                break;
            }
            if seq % BETWEEN == 0 {
                // The observer takes a message, if there is one, and leaves.
                drop(session.harness.rig.tap(output)?.receive());
            }
        }
        // Items are on their way when the request comes.
        session.pace = Pace::Window;
        session.admit()?;
        stops(&mut session, "in the middle of the stream")?;
        drop(never_read);
        let all = 0..session.outputs.len();
        let when = "when the items come one at a time";
        session.compare(&self.first_results, all, Rule::Deterministic, when)
    }
}
