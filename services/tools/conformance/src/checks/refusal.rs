//! Inputs that break the contract: the program ends with exit code 3 and a sentence, and sends nothing about them.

use gyre_stage::StageError;
use gyre_supervise::{Death, rig::Rig};

use super::{Examination, stream::starts};
use crate::{
    ConformanceError,
    malformed::{Malformed, malformed},
    rule::Rule,
    session::{Pace, Session, Waited},
    topology::Way,
};

/// The item that is sent wrong.
const WRONG: u64 = 2;

impl Examination<'_> {
    pub(super) fn refusals(&mut self) -> Result<(), ConformanceError> {
        for (topic, way) in self.subject.ports().inputs {
            let Some(valid) = self.tape.get(topic, WRONG) else {
                continue;
            };
            let mut wrong = malformed(topic, valid)?;
            if let (Way::Forward, Some(later)) = (way, self.tape.get(topic, WRONG + 1)) {
                wrong.push(("a sequence gap", later.clone()));
            }
            for (i, wrong) in wrong.iter().enumerate() {
                (self.observe)(&format!("`{topic}` with {}", wrong.0));
                // Each in a folder of its own: what a stage keeps of one is no matter of the next.
                let rig = self
                    .subject
                    .rig(self.signals, &format!("refusal-{topic}-{i}"))?;
                self.refusal(&rig, topic, way, wrong)?;
            }
        }
        Ok(())
    }

    fn refusal(
        &mut self,
        rig: &Rig<'_>,
        topic: &'static str,
        way: Way,
        (what, message): &Malformed,
    ) -> Result<(), ConformanceError> {
        let mut session = Session::open(self.subject, rig, self.tape, &mut self.findings)?;
        session.until = WRONG;
        if !starts(&mut session)? {
            return Ok(());
        }
        session.connect_all()?;
        let patience = self.subject.demands.patience;
        let before = session.wait(patience, |session| session.newest() >= Some(WRONG - 1))?;
        if !matches!(before, Waited::Done) {
            // What it does with valid items is judged elsewhere.
            return Ok(());
        }
        session.pace = Pace::Hold;
        let others = session
            .ports
            .by(Way::Forward)
            .filter(|other| *other != topic);
        for other in others {
            if let Some(valid) = self.tape.get(other, WRONG) {
                session.feed(other, valid)?;
            }
        }
        session.feed(topic, message)?;
        let ending = session.ended_within(self.subject.demands.patience)?;
        let is_sent = way == Way::Forward && session.about(WRONG).next().is_some();
        session
            .findings
            .require(Rule::RefusesMalformed, !is_sent, || {
                format!("it sent item {WRONG}, although its input on `{topic}` had {what}")
            });
        if let Some(breach) = breach(ending, topic, what) {
            session.findings.broken(Rule::RefusesMalformed, breach);
        }
        Ok(())
    }
}

/// Says what is wrong with the end of a program after a malformed item; `None` if nothing is.
fn breach(ending: Option<Death>, topic: &str, what: &str) -> Option<String> {
    let code = i32::from(StageError::TRANSIENT);
    let item = format!("an item on `{topic}` with {what}");
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
