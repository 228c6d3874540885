//! Inputs that break the contract: the program ends with exit code 3 and a sentence, and sends
//! nothing about them.

use gyre_stage::StageError;
use gyre_supervise::Death;

use super::{Examination, stream::starts};
use crate::conformance::{
    ProgramError,
    malformed::{Malformed, malformed},
    rule::Rule,
    session::{Pace, Session},
    topics::Direction,
};

/// The item that is sent wrong.
const WRONG: u64 = 2;

impl Examination<'_> {
    pub(super) fn refusals(&mut self) -> Result<(), ProgramError> {
        let reference = self.context.reference;
        for (topic, direction) in self.context.test.candidate.topics().inputs {
            let Some(valid) = reference.get(topic, WRONG) else {
                continue;
            };
            let mut wrong = malformed(topic, valid)?;
            let later = reference.get(topic, WRONG + 1);
            if let (Direction::Forward, Some(later)) = (direction, later) {
                wrong.push(("a sequence gap", later.clone()));
            }
            for (i, wrong) in wrong.iter().enumerate() {
                (self.observe)(&format!("`{topic}` with {}", wrong.0));
                // Each in a folder of its own, so that no state is kept from one to the next.
                self.refusal(&format!("refusal-{topic}-{i}"), (topic, direction), wrong)?;
            }
        }
        Ok(())
    }

    fn refusal(
        &mut self,
        name: &str,
        (topic, direction): (&'static str, Direction),
        (fault, message): &Malformed,
    ) -> Result<(), ProgramError> {
        let mut session = Session::open(self.context, name, &mut self.findings)?;
        session.until = WRONG;
        if !starts(&mut session)? {
            return Ok(());
        }
        session.harness.connect()?;
        if !session.reach(WRONG - 1)?.is_done() {
            // Other scenarios judge its work on valid items.
            return Ok(());
        }
        session.pace = Pace::Hold;
        let forward = session.harness.topics.leading(Direction::Forward);
        for other in forward.filter(|other| *other != topic) {
            if let Some(valid) = self.context.reference.get(other, WRONG) {
                session.harness.feed(other, valid)?;
            }
        }
        session.harness.feed(topic, message)?;
        let ending = session.ended_within(session.demands().item_timeout)?;
        let is_sent = direction == Direction::Forward && session.has(WRONG);
        session
            .findings
            .require(Rule::RefusesMalformed, !is_sent, || {
                format!("it sent item {WRONG}, although its input on `{topic}` had {fault}")
            });
        if let Some(breach) = breach(ending, topic, fault) {
            session.findings.broken(Rule::RefusesMalformed, breach);
        }
        Ok(())
    }
}

/// Returns the fault in the end of a program after a malformed item; `None` if the program reported
/// the fault as the contract demands.
fn breach(ending: Option<Death>, topic: &str, fault: &str) -> Option<String> {
    let code = i32::from(StageError::TRANSIENT);
    let item = format!("an item on `{topic}` with {fault}");
    match ending {
        None => Some(format!("it goes on after {item}")),
        Some(death) if death.code != Some(code) => {
            Some(format!("{item}: {death}, and the code has to be {code}"))
        }
        Some(death) if death.last_output.is_none() => {
            Some(format!("{item}: it says nothing on standard error"))
        }
        Some(_) => None,
    }
}
