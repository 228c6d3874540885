//! Inputs that break the contract: the program ends with exit code 3 and a sentence, and sends
//! nothing about them.

use gyre_client::RunError;
use gyre_configuration::terminal::Failure;

use super::Examination;
use crate::conformance::{
    malformed::{Malformed, malformed},
    rule::Rule,
    session::Pace,
};

const WRONG: u64 = 2;

impl Examination<'_> {
    pub(super) fn refusals(&mut self) -> Result<(), Failure> {
        let (reference, topics) = (self.context.reference, self.context.test.candidate.topics());
        for topic in topics.inputs() {
            let Some(valid) = reference.get(topic, WRONG) else {
                continue;
            };
            let mut wrong = malformed(topic, valid)?;
            if topics.forward.contains(&topic) {
                let later = reference.get(topic, WRONG + 1);
                wrong.extend(later.map(|later| ("a sequence gap", later.clone())));
            }
            for (i, wrong) in wrong.iter().enumerate() {
                (self.observe)(&format!("`{topic}` with {}", wrong.0));
                // Each in a folder of its own, so that no state is kept from one to the next.
                self.refusal(&format!("refusal-{topic}-{i}"), topic, wrong)?;
            }
        }
        Ok(())
    }

    fn refusal(
        &mut self,
        name: &str,
        topic: &'static str,
        (fault, message): &Malformed,
    ) -> Result<(), Failure> {
        let (mut session, true) = self.begin(name, Pace::Window, WRONG)? else {
            return Ok(());
        };
        if !session.reach(WRONG - 1)?.is_done() {
            // Other scenarios judge its work on valid items.
            return Ok(());
        }
        session.pace = Pace::Hold;
        let forward = session.harness.topics.forward.clone();
        for other in forward.iter().filter(|other| **other != topic) {
            session.feed(&[*other], WRONG)?;
        }
        session.harness.feed(topic, message)?;
        let ending = session.ended_within(session.arguments().patience_s)?;
        let is_sent = forward.contains(&topic) && session.has(WRONG);
        session
            .findings
            .require(Rule::RefusesMalformed, !is_sent, || {
                format!("it sent item {WRONG}, although its input on `{topic}` had {fault}")
            });
        let code = i32::from(RunError::TRANSIENT);
        let item = format!("an item on `{topic}` with {fault}");
        let breach = match ending {
            None => format!("it continues after {item}"),
            Some(death) if death.code != Some(code) => {
                format!("{item}: {death}, and the code has to be {code}")
            }
            Some(death) if death.last_output.is_none() => {
                format!("{item}: it writes nothing to standard error")
            }
            Some(_) => return Ok(()),
        };
        session.findings.broken(Rule::RefusesMalformed, breach);
        Ok(())
    }
}
