//! Starts after the first: after two deaths, and of a program that stands by.
//!
//! After the first death the inputs are still there, with their history. After the second all other
//! stages are restarted too: no more of the inputs is there than a restarted stage may need.
//!
//! A program that stands by, as for a swap, reports when it is ready, opens nothing before its
//! standard input ends, and then works as after a normal start.

use gyre_configuration::terminal::Failure;
use gyre_contract::{Item, StageId, flag};
use gyre_supervise::rig::{Process, Recorded};

use crate::conformance::{
    Examination,
    report::Rule,
    session::{Pace, Session, Waited},
};

/// Items on their way when the program is killed: fast ones would be done with all before.
const UNDER_WAY: u64 = 2;
/// A program need not stand by.
const DOES_NOT: &str = "it does not stand by: `gyre swap` needs --cold";

impl Examination<'_> {
    pub(crate) fn restart(&mut self) -> Result<(), Failure> {
        let end = self.context.reference.end();
        let (mut session, _) = self.begin("restart", Pace::Window, u64::MAX)?;
        session.until = end / 3 + UNDER_WAY;
        session.reach(end / 3)?;
        session.kill()?;

        let until = end * 2 / 3;
        session.until = until + UNDER_WAY;
        resumes(&mut session, Rule::Resumes, "after kill -9", until)?;
        session.kill()?;

        session.restart_inputs(session.newest.unwrap_or_default())?;
        session.until = u64::MAX;
        let when = "after a restart of all stages, which repeats no more than it may need";
        resumes(&mut session, Rule::LooksBack, when, end)
    }

    pub(crate) fn standing_by(&mut self) -> Result<(), Failure> {
        let mut session = Session::open(self.context, "standing-by", &mut self.findings)?;
        let root = &session.harness.rig.manifest().root;
        let ready = root.join(format!("{}.ready", session.stage().name()));
        session.admit()?;
        session.spawn(true)?;
        let limit = session.arguments().start_timeout_s;
        let waited = session.wait(limit, |session| ready.exists() || session.has_joined())?;
        let lives = session.rest()?;
        let breach = match (ready.exists(), session.has_joined()) {
            (false, true) => {
                session.findings.not_for(Rule::StandsBy, DOES_NOT);
                return Ok(());
            }
            (true, false) if lives => None,
            (true, true) => Some("asked to stand by, it opens its topics before its standard input ends: the program before it is still there".to_owned()),
            _ => Some(match waited {
                Waited::TimedOut => "asked to stand by, it neither reports that it does nor starts, within the start timeout".to_owned(),
                Waited::Done => "asked to stand by, it ended at once".to_owned(),
                Waited::Died(death) => format!("asked to stand by: {death}"),
            }),
        };
        if let Some(breach) = breach {
            session.findings.broken(Rule::StandsBy, breach);
            return Ok(());
        }
        session
            .harness
            .process
            .iter_mut()
            .for_each(Process::end_input);
        let until = session.reference.end() / 3;
        let mut waited = session.wait(limit, |session| session.harness.has_publisher())?;
        if waited.is_done() {
            session.harness.connect()?;
            waited = session.reach(until)?;
        }
        session
            .findings
            .require(Rule::StandsBy, waited.is_done(), || {
                format!(
                    "its standard input has ended, and it has not come to item {until}: {waited}"
                )
            });
        Ok(session.compare(0.., Rule::StandsBy, "after it has stood by")?)
    }
}

/// Starts a killed program again, and requires that it resumes, comes to an item, and sends the
/// results of the first scenario.
fn resumes(session: &mut Session<'_>, rule: Rule, when: &str, until: u64) -> Result<(), Failure> {
    let (newest, sent) = (session.newest, session.outputs.len());
    session.findings.checked(rule);
    if session.starts()? {
        session.harness.connect()?;
        let waited = session.reach(until)?;
        let life: Vec<Item> = session.outputs[sent..].iter().map(Recorded::item).collect();
        session.findings.require(rule, waited.is_done(), || {
            let last = life.iter().map(|it| it.seq).max();
            let reached = last.map_or_else(|| "no item".to_owned(), |seq| format!("item {seq}"));
            format!("{when} it came to {reached} and not to item {until}: {waited}")
        });
        examine_life(session, (rule, when), newest, &life);
    } else {
        let sentence = format!("{when} it does not start");
        session.findings.broken(rule, sentence);
    }
    Ok(session.compare(sent.., rule, when)?)
}

/// Requires that a life after one that came to item `newest` begins where it has to.
fn examine_life(
    session: &mut Session<'_>,
    (rule, when): (Rule, &str),
    newest: Option<u64>,
    life: &[Item],
) {
    let next = newest.map_or(0, |newest| newest + 1);
    if let Some(first) = life.iter().find(|it| !it.is(flag::BASE)) {
        session.findings.require(rule, first.seq <= next, || {
            let seq = first.seq;
            format!("{when} it went on with item {seq}, and its readers need item {next}")
        });
    }
    if session.stage() == StageId::PoseIntegration {
        let marked = life.iter().find(|it| it.is(flag::SYNC));
        let is_newest = marked.is_some_and(|it| Some(it.seq) >= newest && !it.is(flag::BASE));
        session.findings.require(Rule::BeginsWithNewest, is_newest, || {
            format!("{when} it has to send its last poses again, with the flag SYNC on the newest alone, item {} or later", next.saturating_sub(1))
        });
    }
}
