//! One process under test in a run of its own: what is fed to it, and what it sends.

mod examine;
mod feeding;

use std::{
    collections::{BTreeMap, BTreeSet},
    time::{Duration, Instant},
};

use gyre_messages::{Message, Pose, flag};
use gyre_stage::StageError;
use gyre_supervise::{
    Death, Scheduling,
    rig::{Feed, Process, Recorded, Rig, Tap},
};

use crate::{
    ConformanceError,
    content::essence,
    rule::{Findings, Rule},
    subject::Subject,
    tape::{LOOK, Tape, start_of_trajectory},
    topology::{Ports, Way},
};

/// How many items are under way at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pace {
    /// As many as the window admits.
    Window,
    /// One: the next item is sent when the one before is answered.
    Single,
    /// None is sent by itself.
    Hold,
}

/// A process under test, and this program in place of the rest of the run.
pub(crate) struct Session<'a> {
    // Dropped in this order: process, ports, run.
    process: Option<Process>,
    feeds: BTreeMap<&'static str, Box<dyn Feed>>,
    tap: Box<dyn Tap>,
    pub rig: &'a Rig<'a>,
    pub subject: &'a Subject,
    pub tape: &'a Tape,
    pub ports: Ports,
    pub findings: &'a mut Findings,
    pub pace: Pace,
    /// The first item that is not sent by itself.
    pub until: u64,
    /// The next item to be sent.
    next: u64,
    /// The newest item that it has answered.
    newest: Option<u64>,
    /// The last item of this life of the process.
    last: Option<u64>,
    /// What it has sent, in order, over all its lives.
    pub outputs: Vec<Recorded>,
    /// The topics whose publishers it has notified.
    asked: BTreeSet<&'static str>,
    /// When each item was last sent.
    sent_ns: BTreeMap<u64, i64>,
    progress: Instant,
}

/// Why a wait ended.
#[derive(Clone, Debug)]
pub(crate) enum Waited {
    /// What was waited for is there.
    Done,
    /// The process has ended.
    Died(Death),
    /// Nothing happened for too long.
    TimedOut,
}

impl<'a> Session<'a> {
    /// Opens the topics of the stage, and sends what comes first. No process is started.
    ///
    /// # Errors
    /// A failure of the transport.
    pub(crate) fn open(
        subject: &'a Subject,
        rig: &'a Rig<'a>,
        tape: &'a Tape,
        findings: &'a mut Findings,
    ) -> Result<Self, ConformanceError> {
        let ports = subject.ports();
        let mut session = Self {
            process: None,
            feeds: BTreeMap::new(),
            tap: rig.tap(ports.output)?,
            rig,
            subject,
            tape,
            ports,
            findings,
            pace: Pace::Window,
            until: u64::MAX,
            next: 0,
            newest: None,
            last: None,
            outputs: Vec::new(),
            asked: BTreeSet::new(),
            sent_ns: BTreeMap::new(),
            progress: Instant::now(),
        };
        session.open_feeds()?;
        if session.feeds.contains_key(Pose::TOPIC) {
            session.feed(Pose::TOPIC, &start_of_trajectory())?;
        }
        Ok(session)
    }

    fn open_feeds(&mut self) -> Result<(), ConformanceError> {
        for (topic, _) in &self.ports.inputs {
            self.feeds.insert(topic, self.rig.feed(topic)?);
        }
        Ok(())
    }

    /// Starts the process and waits until it has opened the topic that it publishes.
    pub(crate) fn start(&mut self, command: &[String]) -> Result<Waited, ConformanceError> {
        self.spawn(command)?;
        let (stage, limit) = (self.subject.stage, self.subject.demands.start_timeout);
        self.wait(limit, |session| session.rig.has_publisher(stage))
    }

    /// Starts the process.
    pub(crate) fn spawn(&mut self, command: &[String]) -> Result<(), ConformanceError> {
        self.last = None;
        self.asked.clear();
        let name = self.subject.stage.name();
        self.process = Some(self.rig.start(name, command, &Scheduling::default())?);
        Ok(())
    }

    /// Waits until `done`, while the run goes on around the process; `limit` is counted from the last item that it sent.
    pub(crate) fn wait(
        &mut self,
        limit: Duration,
        done: impl Fn(&Self) -> bool,
    ) -> Result<Waited, ConformanceError> {
        self.progress = Instant::now();
        loop {
            self.answer()?;
            self.receive()?;
            self.admit()?;
            if done(self) {
                return Ok(Waited::Done);
            }
            if let Some(death) = self.process.as_mut().and_then(Process::death) {
                self.receive()?;
                return Ok(match done(self) {
                    true => Waited::Done,
                    false => Waited::Died(death),
                });
            }
            if self.progress.elapsed() > limit {
                return Ok(Waited::TimedOut);
            }
            self.sleep()?;
        }
    }

    /// Lets time pass while the run goes on around the process; returns whether it is still alive.
    pub(crate) fn rest(&mut self, time: Duration) -> Result<bool, ConformanceError> {
        let since = Instant::now();
        let ended = self.wait(time, |_| since.elapsed() >= time)?;
        Ok(!matches!(ended, Waited::Died(_)))
    }

    fn sleep(&self) -> Result<(), ConformanceError> {
        match self.rig.sleep(&[self.tap.as_ref()], LOOK)? {
            true => Err(ConformanceError::Interrupted),
            false => Ok(()),
        }
    }

    fn answer(&mut self) -> Result<(), ConformanceError> {
        for (topic, feed) in &self.feeds {
            if feed.answer_handshakes()? {
                self.asked.insert(topic);
            }
        }
        Ok(())
    }

    /// Receives what the process has sent, and examines it.
    fn receive(&mut self) -> Result<(), ConformanceError> {
        loop {
            match self.tap.receive() {
                Ok(None) => return Ok(()),
                Ok(Some(output)) => {
                    self.findings.checked(Rule::SendsValid);
                    self.examine(&output);
                    let item = output.item();
                    self.outputs.push(output);
                    if !item.is(flag::BASE) {
                        self.answered(item.seq)?;
                    }
                }
                Err(StageError::Malformed { seq, reason, .. }) => {
                    let sentence = format!("item {seq} cannot be read by any stage: {reason}");
                    self.findings.broken(Rule::SendsValid, sentence);
                    self.last = Some(seq);
                    self.answered(seq)?;
                }
                Err(error) => return Err(error.into()),
            }
            self.progress = Instant::now();
        }
    }

    /// Kills the process and removes what it leaves.
    pub(crate) fn kill(&mut self) -> Result<(), ConformanceError> {
        if let Some(process) = self.process.take() {
            process.kill()?;
        }
        self.receive()?;
        self.rig.remove_dead()?;
        Ok(())
    }

    /// Sends SIGTERM; returns how the process ended, `None` if it did not in time.
    pub(crate) fn stop(&mut self) -> Result<Option<Death>, ConformanceError> {
        if let Some(process) = &self.process {
            process.terminate();
        }
        self.pace = Pace::Hold;
        self.ended_within(self.subject.demands.stop_timeout)
    }

    /// Waits for the end of the process; `None` if it does not end in time.
    pub(crate) fn ended_within(
        &mut self,
        limit: Duration,
    ) -> Result<Option<Death>, ConformanceError> {
        let since = Instant::now();
        loop {
            self.answer()?;
            self.receive()?;
            if let Some(death) = self.process.as_mut().and_then(Process::death) {
                self.receive()?;
                return Ok(Some(death));
            }
            if since.elapsed() > limit {
                return Ok(None);
            }
            self.sleep()?;
        }
    }

    /// Connects to readers that have not asked, so that what they do otherwise can be seen.
    pub(crate) fn connect_all(&self) -> Result<(), ConformanceError> {
        Ok(self.feeds.values().try_for_each(|feed| feed.connect())?)
    }

    /// Returns the topics that the process has subscribed to without notifying their publishers.
    pub(crate) fn not_asked(&self) -> Vec<&'static str> {
        let silent = self
            .feeds
            .iter()
            .filter(|(topic, feed)| feed.subscribers() > 0 && !self.asked.contains(*topic));
        silent.map(|(topic, _)| *topic).collect()
    }

    /// Returns whether the process has opened a topic.
    pub(crate) fn has_joined(&self) -> bool {
        let mut feeds = self.feeds.values();
        feeds.any(|feed| feed.subscribers() > 0) || self.rig.has_publisher(self.subject.stage)
    }

    /// Returns the inputs that the process has not subscribed to.
    pub(crate) fn not_read(&self) -> Vec<&'static str> {
        let unread = self.ports.by(Way::Forward);
        unread
            .filter(|topic| {
                self.feeds
                    .get(topic)
                    .is_some_and(|it| it.subscribers() == 0)
            })
            .collect()
    }

    /// Returns the newest item that the process has sent.
    pub(crate) fn newest(&self) -> Option<u64> {
        self.newest
    }

    /// Returns what it has sent about an item, in all its lives.
    pub(crate) fn about(&self, seq: u64) -> impl Iterator<Item = &Recorded> {
        let items = self.outputs.iter();
        items.filter(move |it| it.item().seq == seq && !it.item().is(flag::BASE))
    }

    /// Returns the time from when an item was sent to when the first answer to it was read, ns.
    pub(crate) fn answer_ns(&self, seq: u64) -> Option<i64> {
        let (sent_ns, answer) = (self.sent_ns.get(&seq)?, self.about(seq).next()?);
        Some(answer.received_ns.saturating_sub(*sent_ns))
    }

    /// Returns the bytes that its inputs determine, by item: the first of each.
    pub(crate) fn essences(&self) -> Result<BTreeMap<u64, Vec<u8>>, ConformanceError> {
        let mut essences = BTreeMap::new();
        for output in self.outputs.iter().filter(|it| !it.item().is(flag::BASE)) {
            let essence = essence(self.ports.output, output)?;
            essences.entry(output.item().seq).or_insert(essence);
        }
        Ok(essences)
    }
}
