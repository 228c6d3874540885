//! Two deaths. After the first the inputs are still there, with their history. After the second all
//! other stages are restarted too: no more of the inputs is there than a restarted stage may need.

use gyre_messages::{Item, StageId, flag};
use gyre_supervise::rig::Recorded;

use super::{Examination, stream::starts};
use crate::conformance::{ProgramError, rule::Rule, session::Session};

/// Items on their way when the program is killed: fast ones would be done with all before.
const UNDER_WAY: u64 = 2;

impl Examination<'_> {
    pub(super) fn restart(&mut self) -> Result<(), ProgramError> {
        let mut session = Session::open(self.context, "restart", &mut self.findings)?;
        let end = self.context.reference.end();
        starts(&mut session)?;
        session.harness.connect()?;
        session.until = end / 3 + UNDER_WAY;
        session.reach(end / 3)?;
        session.kill()?;

        let first_life = session.outputs.len();
        let resumes = Restart {
            rule: Rule::Resumes,
            when: "after kill -9",
            until: end * 2 / 3,
        };
        session.until = resumes.until + UNDER_WAY;
        resumes.examine(&mut session)?;
        let all = first_life..session.outputs.len();
        session.compare(&self.first_results, all, resumes.rule, resumes.when)?;
        session.kill()?;

        let second_life = session.outputs.len();
        let newest = session.newest().unwrap_or_default();
        session.restart_inputs(newest)?;
        session.until = u64::MAX;
        let looks_back = Restart {
            rule: Rule::LooksBack,
            when: "after a restart of all stages, which repeats no more than it may need",
            until: end,
        };
        looks_back.examine(&mut session)?;
        let all = second_life..session.outputs.len();
        session.compare(&self.first_results, all, looks_back.rule, looks_back.when)
    }
}

/// The demands on a restarted program.
struct Restart {
    rule: Rule,
    when: &'static str,
    /// The item that the program has to come to.
    until: u64,
}

impl Restart {
    /// Starts the program again, and requires that it resumes.
    fn examine(&self, session: &mut Session<'_>) -> Result<(), ProgramError> {
        let Self { rule, when, until } = *self;
        let (newest, sent) = (session.newest(), session.outputs.len());
        let next = newest.map_or(0, |newest| newest + 1);
        session.findings.checked(rule);
        if !starts(session)? {
            let sentence = format!("{when} it does not start");
            session.findings.broken(rule, sentence);
            return Ok(());
        }
        session.harness.connect()?;
        let waited = session.reach(until)?;
        let life: Vec<Item> = session.outputs[sent..].iter().map(Recorded::item).collect();
        session.findings.require(rule, waited.is_done(), || {
            let last = life.iter().map(|it| it.seq).max();
            let reached = last.map_or_else(|| "no item".to_owned(), |seq| format!("item {seq}"));
            format!("{when} it came to {reached} and not to item {until}: {waited}")
        });
        if let Some(first) = life.iter().find(|it| !it.is(flag::BASE)) {
            session.findings.require(rule, first.seq <= next, || {
                format!(
                    "{when} it went on with item {}, and its readers need item {next}",
                    first.seq
                )
            });
        }
        if session.stage() == StageId::PoseIntegration {
            let marked = life.iter().find(|it| it.is(flag::SYNC));
            let is_newest = marked.is_some_and(|it| Some(it.seq) >= newest && !it.is(flag::BASE));
            session.findings.require(Rule::BeginsWithNewest, is_newest, || {
                format!("{when} it has to send its last poses again, with the flag SYNC on the newest alone, item {} or later", next.saturating_sub(1))
            });
        }
        Ok(())
    }
}
