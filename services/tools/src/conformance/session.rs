//! One process under test in a run of its own: its inputs and its outputs.

mod examine;
mod feeding;

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
    ops::Range,
    time::{Duration, Instant},
};

use gyre_messages::{Message, Pose, StageId, flag};
use gyre_supervise::{Death, Scheduling, rig::Recorded};

use crate::conformance::{
    ProgramError,
    harness::{Harness, Sent, start_of_trajectory},
    reference::{Context, POLL_PERIOD, Reference},
    result::result_bytes,
    rule::{Findings, Rule},
    test::{Demands, Test},
    topics::Direction,
};

/// The number of items under way at most.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Pace {
    /// As many as the window admits.
    Window,
    /// One: the next item is sent when the one before is answered.
    Single,
    /// No item is sent automatically.
    Hold,
}

/// A process under test, and this program in place of the rest of the run.
pub(crate) struct Session<'a> {
    pub harness: Harness<'a>,
    pub test: &'a Test,
    pub reference: &'a Reference,
    pub findings: &'a mut Findings,
    pub pace: Pace,
    /// The first item that is not sent automatically.
    pub until: u64,
    /// The next item to be sent.
    next: u64,
    /// The newest item that it has answered.
    newest: Option<u64>,
    /// The last item of this life of the process.
    last: Option<u64>,
    /// The outputs, in order, over all its lives.
    pub outputs: Vec<Recorded>,
    /// The topics whose publishers it has notified.
    notified: BTreeSet<&'static str>,
    /// The time of the first sending of each item: an item that a sink has journalled in one life
    /// and sends in the next keeps its stamps.
    sent_ns: BTreeMap<u64, i64>,
    progress: Instant,
}

/// The end of a wait.
#[derive(Clone, Debug)]
pub(crate) enum Waited {
    /// The condition holds.
    Done,
    /// The process has ended.
    Died(Death),
    /// Nothing happened for too long.
    TimedOut,
}

impl Waited {
    pub(crate) fn is_done(&self) -> bool {
        matches!(self, Self::Done)
    }
}

impl fmt::Display for Waited {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Done => f.write_str("it did"),
            Self::Died(death) => write!(f, "{death}"),
            Self::TimedOut => f.write_str("it lives and sends nothing"),
        }
    }
}

impl<'a> Session<'a> {
    /// Creates a run of this name, opens the topics of the stage, and sends the start of the
    /// trajectory. No process is started.
    pub(crate) fn open(
        context: Context<'a>,
        name: &str,
        findings: &'a mut Findings,
    ) -> Result<Self, ProgramError> {
        let Context {
            test,
            reference,
            signals,
        } = context;
        let harness = Harness::open(test.rig(name, signals, true)?, test.candidate.stage)?;
        harness.feed(Pose::TOPIC, &start_of_trajectory())?;
        Ok(Self {
            harness,
            test,
            reference,
            findings,
            pace: Pace::Window,
            until: u64::MAX,
            next: 0,
            newest: None,
            last: None,
            outputs: Vec::new(),
            notified: BTreeSet::new(),
            sent_ns: BTreeMap::new(),
            progress: Instant::now(),
        })
    }

    pub(crate) fn stage(&self) -> StageId {
        self.test.candidate.stage
    }

    pub(crate) fn demands(&self) -> &'a Demands {
        &self.test.demands
    }

    /// Returns the topic that the process publishes.
    pub(crate) fn output_topic(&self) -> &'static str {
        self.harness.topics.output
    }

    /// Starts the process and waits until it has opened the topic that it publishes.
    pub(crate) fn start(&mut self, command: &[String]) -> Result<Waited, ProgramError> {
        self.spawn(command)?;
        let limit = self.demands().start_timeout;
        self.wait(limit, |session| session.harness.has_publisher())
    }

    /// Starts the process.
    pub(crate) fn spawn(&mut self, command: &[String]) -> Result<(), ProgramError> {
        self.last = None;
        self.notified.clear();
        self.harness.start(command, &Scheduling::default())
    }

    /// Waits until the process has answered an item; the limit is that for one item.
    pub(crate) fn reach(&mut self, seq: u64) -> Result<Waited, ProgramError> {
        let limit = self.demands().item_timeout;
        self.wait(limit, |session| session.newest >= Some(seq))
    }

    /// Waits until `done`, while the run continues around the process; `limit` is counted from the
    /// last item that it sent.
    pub(crate) fn wait(
        &mut self,
        limit: Duration,
        done: impl Fn(&Self) -> bool,
    ) -> Result<Waited, ProgramError> {
        self.progress = Instant::now();
        loop {
            self.exchange()?;
            self.admit()?;
            if done(self) {
                return Ok(Waited::Done);
            }
            if let Some(death) = self.harness.death() {
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

    /// Waits for a time while the run continues around the process; returns whether the process is
    /// still alive.
    pub(crate) fn rest(&mut self, time: Duration) -> Result<bool, ProgramError> {
        let since = Instant::now();
        let ended = self.wait(time, |_| since.elapsed() >= time)?;
        Ok(!matches!(ended, Waited::Died(_)))
    }

    fn sleep(&self) -> Result<(), ProgramError> {
        match self.harness.sleep(POLL_PERIOD)? {
            true => Err(ProgramError::Interrupted),
            false => Ok(()),
        }
    }

    /// Answers handshakes and receives.
    fn exchange(&mut self) -> Result<(), ProgramError> {
        self.notified.extend(self.harness.answer_handshakes()?);
        self.receive()
    }

    /// Receives the messages of the process, and examines them.
    fn receive(&mut self) -> Result<(), ProgramError> {
        while let Some(sent) = self.harness.receive()? {
            match sent {
                Sent::Message(output) => {
                    self.findings.checked(Rule::SendsValid);
                    self.examine(&output);
                    let item = output.item();
                    self.outputs.push(output);
                    if !item.is(flag::BASE) {
                        self.answered(item.seq)?;
                    }
                }
                Sent::Malformed { seq, sentence } => {
                    self.findings.broken(Rule::SendsValid, sentence);
                    self.last = Some(seq);
                    self.answered(seq)?;
                }
            }
            self.progress = Instant::now();
        }
        Ok(())
    }

    /// Kills the process and removes its leftovers.
    pub(crate) fn kill(&mut self) -> Result<(), ProgramError> {
        self.harness.kill()?;
        self.receive()?;
        Ok(self.harness.rig.remove_dead()?)
    }

    /// Sends SIGTERM; returns how the process ended, `None` if it did not in time.
    pub(crate) fn stop(&mut self) -> Result<Option<Death>, ProgramError> {
        self.harness.terminate();
        self.pace = Pace::Hold;
        self.ended_within(self.demands().stop_timeout)
    }

    /// Waits for the end of the process; `None` if it does not end in time.
    pub(crate) fn ended_within(&mut self, limit: Duration) -> Result<Option<Death>, ProgramError> {
        let since = Instant::now();
        loop {
            self.exchange()?;
            if let Some(death) = self.harness.death() {
                self.receive()?;
                return Ok(Some(death));
            }
            if since.elapsed() > limit {
                return Ok(None);
            }
            self.sleep()?;
        }
    }

    /// Returns the topics that the process has subscribed to without notifying their publishers.
    pub(crate) fn not_notified(&self) -> Vec<&'static str> {
        let feeds = self.harness.feeds.iter();
        let silent =
            feeds.filter(|(topic, feed)| feed.subscribers() > 0 && !self.notified.contains(*topic));
        silent.map(|(topic, _)| *topic).collect()
    }

    /// Returns whether the process has opened a topic.
    pub(crate) fn has_joined(&self) -> bool {
        let mut feeds = self.harness.feeds.values();
        feeds.any(|feed| feed.subscribers() > 0) || self.harness.has_publisher()
    }

    /// Returns the inputs that the process has not subscribed to.
    pub(crate) fn not_read(&self) -> Vec<&'static str> {
        let feeds = &self.harness.feeds;
        let is_unread = |topic: &&str| feeds.get(topic).is_some_and(|it| it.subscribers() == 0);
        let inputs = self.harness.topics.leading(Direction::Forward);
        inputs.filter(is_unread).collect()
    }

    /// Returns the newest item that the process has sent.
    pub(crate) fn newest(&self) -> Option<u64> {
        self.newest
    }

    /// Returns its messages about an item, in all its lives.
    pub(crate) fn about(&self, seq: u64) -> impl Iterator<Item = &Recorded> {
        let items = self.outputs.iter();
        items.filter(move |it| it.item().seq == seq && !it.item().is(flag::BASE))
    }

    /// Returns whether it has sent something about an item.
    pub(crate) fn has(&self, seq: u64) -> bool {
        self.about(seq).next().is_some()
    }

    /// Returns the time from when an item was first sent to when the first answer to it was read,
    /// ns.
    pub(crate) fn answer_ns(&self, seq: u64) -> Option<i64> {
        let (sent_ns, answer) = (self.sent_ns.get(&seq)?, self.about(seq).next()?);
        Some(answer.received_ns.saturating_sub(*sent_ns))
    }

    /// Returns the result bytes of the first message about each item.
    pub(crate) fn results(&self) -> Result<BTreeMap<u64, Vec<u8>>, ProgramError> {
        let mut results = BTreeMap::new();
        for output in self.outputs.iter().filter(|it| !it.item().is(flag::BASE)) {
            let bytes = result_bytes(self.output_topic(), output)?;
            results.entry(output.item().seq).or_insert(bytes);
        }
        Ok(results)
    }

    /// Notes each output whose bytes differ from the first scenario.
    pub(crate) fn compare(
        &mut self,
        first: &BTreeMap<u64, Vec<u8>>,
        outputs: Range<usize>,
        rule: Rule,
        when: &str,
    ) -> Result<(), ProgramError> {
        self.findings.checked(rule);
        for output in &self.outputs[outputs] {
            let item = output.item();
            let bytes = result_bytes(self.harness.topics.output, output)?;
            let differs = first.get(&item.seq).is_some_and(|first| *first != bytes);
            if differs && !item.is(flag::BASE) {
                let sentence = format!("item {} has other bytes {when}", item.seq);
                self.findings.broken(rule, sentence);
            }
        }
        Ok(())
    }
}
