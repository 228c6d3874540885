//! A whole stream with a full window, from a history that is there before the program, to the end
//! and SIGTERM.

use std::cell::Cell;

use gyre_configuration::terminal::Failure;
use gyre_contract::{StageId, flag};
use gyre_supervise::rig::Process;

use crate::conformance::{
    Examination,
    report::Rule,
    result::result_bytes,
    session::{Pace, Session, Waited},
};

impl Examination<'_> {
    pub(crate) fn stream(&mut self) -> Result<bool, Failure> {
        let mut session = Session::open(self.context, "stream", &mut self.findings)?;
        let before = session.harness.rig.services();
        session.admit()?;
        if !session.starts()? {
            return Ok(false);
        }
        session.joins()?;
        let has_ended = session.reaches_the_end()?;
        // It may have subscribed to a feedback since.
        session.asks_for_history()?;
        let services = session.harness.rig.services();
        let created = services.difference(&before).count();
        session
            .findings
            .require(Rule::CreatesNothing, created == 0, || {
                format!("it has created {created} services of its own")
            });
        if has_ended {
            session.waits_after_the_end()?;
        }
        session.gives_history()?;
        if session.stage() == StageId::PoseIntegration {
            let first = session.outputs.first();
            let is_start = first.is_some_and(|first| first.item().is(flag::BASE | flag::SYNC));
            session.findings.require(Rule::BeginsWithNewest, is_start, || {
                "without a journal it has to begin with a pose that has the flags BASE and SYNC: the source and masking wait for it".to_owned()
            });
        }
        session.stops("after the end of the stream")?;
        self.outputs = std::mem::take(&mut session.outputs);
        let topic = session.output_topic();
        let results = &mut session.findings.first_results;
        for output in self.outputs.iter().filter(|it| !it.item().is(flag::BASE)) {
            let bytes = result_bytes(topic, output)?;
            results.entry(output.item().seq).or_insert(bytes);
        }
        Ok(results.len() > 1)
    }

    /// The source: without a pose it sends the items of one window, and waits.
    pub(crate) fn window(&mut self) -> Result<(), Failure> {
        let end = self.context.reference.end() as usize;
        let (mut session, _) = self.begin("window", Pace::Hold, u64::MAX)?;
        let window = session.harness.rig.manifest().window.scans.min(end);
        let limit = session.arguments().patience_s;
        session.wait(limit, |it| it.outputs.len() >= window)?;
        session.rest()?;
        let sent = session.outputs.len();
        session
            .findings
            .require(Rule::KeepsWindow, sent == window, || {
                format!("it sent {sent} items before the first pose, and the window is {window}")
            });
        Ok(())
    }
}

impl Session<'_> {
    pub(crate) fn starts(&mut self) -> Result<bool, Failure> {
        let topic = self.output_topic();
        self.spawn(false)?;
        let limit = self.arguments().start_timeout_s;
        let waited = self.wait(limit, |session| session.harness.has_publisher())?;
        let is_open = waited.is_done();
        self.findings
            .require(Rule::StartsInTime, is_open, || match &waited {
                Waited::Died(death) => format!("it has not opened `{topic}`: {death}"),
                _ => format!("it has not opened `{topic}` within the start timeout"),
            });
        Ok(is_open)
    }

    /// Requires that it subscribes to its inputs, and the handshake of each.
    fn joins(&mut self) -> Result<(), Failure> {
        let limit = self.arguments().patience_s;
        self.findings.checked(Rule::AsksForHistory);
        self.wait(limit, |session| session.not_read().is_empty())?;
        for topic in self.not_read() {
            let sentence = format!("it has not subscribed to `{topic}`");
            self.findings.broken(Rule::AsksForHistory, sentence);
        }
        self.asks_for_history()?;
        Ok(self.harness.connect()?)
    }

    /// Requires that it notifies the publisher of each topic that it has subscribed to.
    fn asks_for_history(&mut self) -> Result<(), Failure> {
        let limit = self.arguments().patience_s;
        self.wait(limit, |session| session.not_notified().is_empty())?;
        for topic in self.not_notified() {
            let sentence = format!(
                "it has subscribed to `{topic}` without notifying `{topic}_handshake`: it would wait for the history until the next item"
            );
            self.findings.broken(Rule::AsksForHistory, sentence);
        }
        Ok(())
    }

    fn reaches_the_end(&mut self) -> Result<bool, Failure> {
        let end = self.reference.end();
        self.findings.checked(Rule::OneForOne);
        self.findings.checked(Rule::PassesEnd);
        let waited = self.reach(end)?;
        let missing: Vec<u64> = (0..end).filter(|seq| !self.has(*seq)).collect();
        if let Some(first) = missing.first() {
            let count = missing.len();
            let why = match waited.is_done() {
                true => String::new(),
                false => format!(": {waited}"),
            };
            let sentence =
                format!("it sent nothing about item {first} ({count} of {end} are missing){why}");
            self.findings.broken(Rule::OneForOne, sentence);
        }
        let has_end = self.about(end).any(|last| last.item().is(flag::END));
        let has_all_but_end = self.newest.map(|newest| newest + 1) >= Some(end);
        if !has_end && has_all_but_end {
            let sentence =
                format!("it has not passed on item {end}, the end of the stream: {waited}");
            self.findings.broken(Rule::PassesEnd, sentence);
        }
        Ok(has_end)
    }

    fn waits_after_the_end(&mut self) -> Result<(), Failure> {
        let sent = self.outputs.len();
        let lives = self.rest()?;
        self.findings.require(Rule::PassesEnd, lives, || {
            "it ended at the end of the stream: wait for SIGTERM, its history may still be needed"
                .to_owned()
        });
        let more = self.outputs.len() - sent;
        self.findings.require(Rule::PassesEnd, more == 0, || {
            format!("it sent {more} more items after the end of the stream")
        });
        Ok(())
    }

    /// Requires that a reader which comes now receives the newest items.
    fn gives_history(&mut self) -> Result<(), Failure> {
        let (topic, rig) = (self.output_topic(), &self.harness.rig);
        let sizes = gyre_contract::topic(topic).map(|it| (it.sizes)(&rig.manifest().window));
        let wanted = sizes.map_or(0, |it| it.history).min(self.outputs.len());
        let (late, received) = (rig.tap(topic)?, Cell::new(0));
        self.wait(self.arguments().patience_s, |_| {
            while late.receive().is_ok_and(|message| message.is_some()) {
                received.set(received.get() + 1);
            }
            received.get() >= wanted
        })?;
        let received = received.get();
        self.findings.require(Rule::GivesHistory, received >= wanted, || {
            format!("a late reader that notified `{topic}_handshake` received {received} of the last {wanted} items: call update_connections, then notify `{topic}_data`")
        });
        Ok(())
    }

    pub(crate) fn stops(&mut self, when: &str) -> Result<(), Failure> {
        let limit = self.arguments().stop_timeout_s;
        self.harness.process.iter().for_each(Process::terminate);
        self.pace = Pace::Hold;
        let breach = match self.ended_within(limit)? {
            None => Some(format!(
                "it has not exited within {limit:.0?} of SIGTERM {when}"
            )),
            Some(death) if death.code != Some(0) => Some(format!("SIGTERM {when}: {death}")),
            Some(_) => None,
        };
        self.findings.checked(Rule::StopsOnRequest);
        if let Some(breach) = breach {
            self.findings.broken(Rule::StopsOnRequest, breach);
        }
        Ok(())
    }
}
