//! A whole stream with a full window, from a history that is there before the program, to the end
//! and SIGTERM.

use std::time::Instant;

use gyre_messages::{StageId, flag};

use super::Examination;
use crate::conformance::{
    ProgramError,
    reference::POLL_PERIOD,
    rule::Rule,
    session::{Pace, Session, Waited},
};

impl Examination<'_> {
    /// Returns whether the program has worked on items, so that more can be tested.
    pub(super) fn stream(&mut self) -> Result<bool, ProgramError> {
        let mut session = Session::open(self.context, "stream", &mut self.findings)?;
        let before = session.harness.rig.services();
        session.admit()?;
        if !starts(&mut session)? {
            return Ok(false);
        }
        joins(&mut session)?;
        let has_ended = reaches_the_end(&mut session)?;
        // It may have subscribed to a feedback since.
        asks_for_history(&mut session)?;
        let services = session.harness.rig.services();
        let created = services.difference(&before).count();
        session
            .findings
            .require(Rule::CreatesNothing, created == 0, || {
                format!("it has created {created} services of its own")
            });
        if has_ended {
            waits_after_the_end(&mut session)?;
        }
        gives_history(&mut session)?;
        begins_with_newest(&mut session);
        stops(&mut session, "after the end of the stream")?;
        self.first_results = session.results()?;
        self.outputs = std::mem::take(&mut session.outputs);
        Ok(self.first_results.len() > 1)
    }

    /// The source: without a pose it sends the items of one window, and waits.
    pub(super) fn window(&mut self) -> Result<(), ProgramError> {
        let mut session = Session::open(self.context, "window", &mut self.findings)?;
        session.pace = Pace::Hold;
        starts(&mut session)?;
        let (demands, scans) = (
            session.demands(),
            session.harness.rig.manifest().window.scans,
        );
        let window = scans.min(self.context.reference.end() as usize);
        let has_sent = |session: &Session<'_>| session.outputs.len() >= window;
        session.wait(demands.item_timeout, has_sent)?;
        session.rest(demands.quiet)?;
        let sent = session.outputs.len();
        session
            .findings
            .require(Rule::KeepsWindow, sent == window, || {
                format!("it sent {sent} items before the first pose, and the window is {window}")
            });
        Ok(())
    }
}

/// Starts the program, and requires that it opens its topic.
pub(super) fn starts(session: &mut Session<'_>) -> Result<bool, ProgramError> {
    let topic = session.output_topic();
    let waited = session.start(&session.test.candidate.command)?;
    let is_open = waited.is_done();
    session
        .findings
        .require(Rule::StartsInTime, is_open, || match &waited {
            Waited::Died(death) => format!("it has not opened `{topic}`: {death}"),
            _ => format!("it has not opened `{topic}` within the start timeout"),
        });
    Ok(is_open)
}

/// Requires that it subscribes to its inputs, and the handshake of each.
fn joins(session: &mut Session<'_>) -> Result<(), ProgramError> {
    session.findings.checked(Rule::AsksForHistory);
    session.wait(session.demands().item_timeout, |session| {
        session.not_read().is_empty()
    })?;
    for topic in session.not_read() {
        let sentence = format!("it has not subscribed to `{topic}`");
        session.findings.broken(Rule::AsksForHistory, sentence);
    }
    asks_for_history(session)?;
    Ok(session.harness.connect()?)
}

/// Requires that it notifies the publisher of each topic that it has subscribed to.
fn asks_for_history(session: &mut Session<'_>) -> Result<(), ProgramError> {
    let waited = session.wait(session.demands().item_timeout, |session| {
        session.not_notified().is_empty()
    })?;
    if !waited.is_done() {
        for topic in session.not_notified() {
            let sentence = format!(
                "it has subscribed to `{topic}` without notifying `{topic}_handshake`: it would wait for the history until the next item"
            );
            session.findings.broken(Rule::AsksForHistory, sentence);
        }
    }
    Ok(())
}

/// Requires an item for each, and the end.
fn reaches_the_end(session: &mut Session<'_>) -> Result<bool, ProgramError> {
    let end = session.reference.end();
    session.findings.checked(Rule::OneForOne);
    session.findings.checked(Rule::PassesEnd);
    let waited = session.reach(end)?;
    let missing: Vec<u64> = (0..end).filter(|seq| !session.has(*seq)).collect();
    if let Some(first) = missing.first() {
        let count = missing.len();
        let why = match waited.is_done() {
            true => String::new(),
            false => format!(": {waited}"),
        };
        let sentence =
            format!("it sent nothing about item {first} ({count} of {end} are missing){why}");
        session.findings.broken(Rule::OneForOne, sentence);
    }
    let has_end = session.about(end).any(|last| last.item().is(flag::END));
    let has_all_but_end = session.newest().map(|newest| newest + 1) >= Some(end);
    if !has_end && has_all_but_end {
        let sentence = format!("it has not passed on item {end}, the end of the stream: {waited}");
        session.findings.broken(Rule::PassesEnd, sentence);
    }
    Ok(has_end)
}

fn waits_after_the_end(session: &mut Session<'_>) -> Result<(), ProgramError> {
    let sent = session.outputs.len();
    let lives = session.rest(session.demands().quiet)?;
    session.findings.require(Rule::PassesEnd, lives, || {
        "it ended at the end of the stream: wait for SIGTERM, its history may still be needed"
            .to_owned()
    });
    let more = session.outputs.len() - sent;
    session.findings.require(Rule::PassesEnd, more == 0, || {
        format!("it sent {more} more items after the end of the stream")
    });
    Ok(())
}

/// Requires that a reader which comes now receives the newest items.
fn gives_history(session: &mut Session<'_>) -> Result<(), ProgramError> {
    let topic = session.output_topic();
    let history = session.harness.topics.sizes.history;
    let wanted = history.min(session.outputs.len());
    let late = session.harness.rig.tap(topic)?;
    let mut received = 0;
    let since = Instant::now();
    while received < wanted && since.elapsed() < session.demands().item_timeout {
        while late.receive().is_ok_and(|message| message.is_some()) {
            received += 1;
        }
        let rig = &session.harness.rig;
        if rig.sleep(&[late.as_ref()], POLL_PERIOD)? {
            return Err(ProgramError::Interrupted);
        }
    }
    session
        .findings
        .require(Rule::GivesHistory, received >= wanted, || {
            format!("a late reader that notified `{topic}_handshake` received {received} of the last {wanted} items: call update_connections, then notify `{topic}_data`")
        });
    Ok(())
}

fn begins_with_newest(session: &mut Session<'_>) {
    if session.stage() != StageId::PoseIntegration {
        return;
    }
    let first = session.outputs.first();
    let is_start = first.is_some_and(|first| first.item().is(flag::BASE | flag::SYNC));
    session
        .findings
        .require(Rule::BeginsWithNewest, is_start, || {
            "without a journal it has to begin with a pose that has the flags BASE and SYNC: the source and masking wait for it".to_owned()
        });
}

/// Sends SIGTERM, and requires the exit code 0.
pub(super) fn stops(session: &mut Session<'_>, when: &str) -> Result<(), ProgramError> {
    let limit = session.demands().stop_timeout;
    session.findings.checked(Rule::StopsOnRequest);
    match session.stop()? {
        None => session.findings.broken(
            Rule::StopsOnRequest,
            format!("it has not exited within {limit:.0?} of SIGTERM {when}"),
        ),
        Some(death) if death.code != Some(0) => session
            .findings
            .broken(Rule::StopsOnRequest, format!("SIGTERM {when}: {death}")),
        Some(_) => {}
    }
    Ok(())
}
