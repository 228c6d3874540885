//! Two deaths. After the first the inputs are still there, with their history. After the second all other stages are restarted too: no
//! more of the inputs is there than a restarted stage may need.

use gyre_messages::{StageId, flag};

use super::{Examination, compare, how, stream::starts};
use crate::{
    ConformanceError,
    rule::Rule,
    session::{Session, Waited},
};

/// Items on their way when the program is killed: fast ones would be done with all before.
const UNDER_WAY: u64 = 2;

impl Examination<'_> {
    pub(super) fn restart(&mut self) -> Result<(), ConformanceError> {
        let rig = self.subject.rig(self.signals, "restart")?;
        let mut session = Session::open(self.subject, &rig, self.tape, &mut self.findings)?;
        let (end, patience) = (self.tape.end(), self.subject.demands.patience);
        starts(&mut session)?;
        session.connect_all()?;
        session.until = end / 3 + UNDER_WAY;
        session.wait(patience, |session| session.newest() >= Some(end / 3))?;
        session.kill()?;

        let first_life = session.outputs.len();
        let goes_on = Death {
            rule: Rule::Resumes,
            when: "after kill -9",
            until: end * 2 / 3,
        };
        session.until = goes_on.until + UNDER_WAY;
        goes_on.examine(&mut session)?;
        let all = first_life..session.outputs.len();
        compare(
            &mut session,
            &self.reference,
            all,
            Rule::Resumes,
            "after kill -9",
        )?;
        session.kill()?;

        let second_life = session.outputs.len();
        let newest = session.newest().unwrap_or_default();
        session.restart_inputs(newest)?;
        session.until = u64::MAX;
        let goes_on = Death {
            rule: Rule::LooksBack,
            when: "after a restart of all stages, which repeats no more than it may need",
            until: end,
        };
        goes_on.examine(&mut session)?;
        let all = second_life..session.outputs.len();
        compare(
            &mut session,
            &self.reference,
            all,
            Rule::LooksBack,
            goes_on.when,
        )
    }
}

/// What is required after a death.
struct Death {
    rule: Rule,
    when: &'static str,
    /// The item that the program has to come to.
    until: u64,
}

impl Death {
    /// Starts the program again, and requires that it goes on.
    fn examine(&self, session: &mut Session<'_>) -> Result<(), ConformanceError> {
        let Self { rule, when, until } = *self;
        let (newest, sent) = (session.newest(), session.outputs.len());
        let next = newest.map_or(0, |newest| newest + 1);
        session.findings.checked(rule);
        if !starts(session)? {
            let sentence = format!("{when} it does not start");
            session.findings.broken(rule, sentence);
            return Ok(());
        }
        session.connect_all()?;
        let patience = session.subject.demands.patience;
        let waited = session.wait(patience, |session| session.newest() >= Some(until))?;
        let went_on = matches!(waited, Waited::Done);
        session.findings.require(rule, went_on, || {
            let reached = last_of(&session.outputs[sent..]);
            format!(
                "{when} it came to {reached} and not to item {until}: {}",
                how(&waited)
            )
        });
        let life = &session.outputs[sent..];
        let first = life
            .iter()
            .map(|it| it.item())
            .find(|it| !it.is(flag::BASE));
        if let Some(first) = first {
            session.findings.require(rule, first.seq <= next, || {
                format!(
                    "{when} it went on with item {}, and its readers need item {next}",
                    first.seq
                )
            });
        }
        if session.subject.stage == StageId::PoseIntegration {
            let marked = life.iter().map(|it| it.item()).find(|it| it.is(flag::SYNC));
            let is_newest = marked.is_some_and(|it| Some(it.seq) >= newest && !it.is(flag::BASE));
            session.findings.require(Rule::BeginsWithNewest, is_newest, || {
                format!("{when} it has to send its last poses again, with the flag SYNC on the newest alone, item {} or later", next.saturating_sub(1))
            });
        }
        Ok(())
    }
}

fn last_of(outputs: &[gyre_supervise::rig::Recorded]) -> String {
    let last = outputs.iter().map(|it| it.item().seq).max();
    last.map_or_else(|| "no item".to_owned(), |seq| format!("item {seq}"))
}
