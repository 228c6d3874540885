//! One process under test in a run of its own: its inputs and its outputs.

use std::{
    collections::{BTreeMap, BTreeSet},
    fmt,
    ops::RangeFrom,
    time::{Duration, Instant},
};

use gyre_client::{RunError, clock};
use gyre_configuration::terminal::Failure;
use gyre_contract::{Item, Message, Pose, StageId, flag};
use gyre_supervise::{
    Death, SuperviseError,
    rig::{Process, Recorded},
};

use crate::conformance::{
    ConformanceArguments, Test,
    harness::{Harness, Sent, start_of_trajectory},
    reference::{Context, POLL_PERIOD, Reference},
    report::{Findings, Rule},
    result::{not_copied, result_bytes, wrong_stamps},
};

/// The time of watching a program that must send nothing.
const QUIET: Duration = Duration::from_millis(300);

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

pub(crate) struct Session<'a> {
    pub harness: Harness<'a>,
    pub test: &'a Test<'a>,
    pub reference: &'a Reference,
    pub findings: &'a mut Findings,
    pub pace: Pace,
    /// The first item that is not sent automatically.
    pub until: u64,
    next: u64,
    pub newest: Option<u64>,
    /// The last item of this life of the process.
    last: Option<u64>,
    /// The outputs, in order, over all its lives.
    pub outputs: Vec<Recorded>,
    notified: BTreeSet<&'static str>,
    /// The time of the first sending of each item: an item that a sink has journalled in one life
    /// and sends in the next keeps its stamps.
    sent_ns: BTreeMap<u64, i64>,
}

#[derive(Clone, Debug)]
pub(crate) enum Waited {
    Done,
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
    ) -> Result<Self, Failure> {
        let (test, reference) = (context.test, context.reference);
        let rig = test.rig(name, context.signals)?;
        let harness = Harness::open(rig, &test.candidate)?;
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
        })
    }

    pub(crate) fn stage(&self) -> StageId {
        self.test.candidate.stage
    }

    pub(crate) fn arguments(&self) -> &'a ConformanceArguments {
        self.test.arguments
    }

    pub(crate) fn output_topic(&self) -> &'static str {
        self.harness.topics.output
    }

    pub(crate) fn spawn(&mut self, stands_by: bool) -> Result<(), SuperviseError> {
        self.last = None;
        self.notified.clear();
        self.harness.start(stands_by)
    }

    /// Waits until the process has answered an item; the limit is that for one item.
    pub(crate) fn reach(&mut self, seq: u64) -> Result<Waited, Failure> {
        let limit = self.arguments().patience_s;
        self.wait(limit, |session| session.newest >= Some(seq))
    }

    /// Waits until `done`, while the run continues around the process; `limit` is counted from the
    /// last item that it sent.
    pub(crate) fn wait(
        &mut self,
        limit: Duration,
        done: impl Fn(&Self) -> bool,
    ) -> Result<Waited, Failure> {
        let mut progress = Instant::now();
        loop {
            self.notified.extend(self.harness.answer_handshakes()?);
            if self.receive()? {
                progress = Instant::now();
            }
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
            if progress.elapsed() > limit {
                return Ok(Waited::TimedOut);
            }
            self.harness
                .rig
                .sleep(&[&self.harness.output], POLL_PERIOD)?;
        }
    }

    /// Waits while the run continues around a process that must send nothing; returns whether the
    /// process is still alive.
    pub(crate) fn rest(&mut self) -> Result<bool, Failure> {
        Ok(self.ended_within(QUIET)?.is_none())
    }

    /// Takes the messages that the process has sent; returns whether there were any.
    fn receive(&mut self) -> Result<bool, RunError> {
        let mut any = false;
        while let Some(sent) = self.harness.receive()? {
            any = true;
            match sent {
                Sent::Message(output) => {
                    self.findings.checked(Rule::SendsValid);
                    let item = output.item();
                    if item.is(flag::BASE) {
                        self.outputs.push(output);
                    } else {
                        self.examine(&item, output.received_ns);
                        self.outputs.push(output);
                        self.answered(item.seq)?;
                    }
                }
                Sent::Malformed { seq, sentence } => {
                    self.findings.broken(Rule::SendsValid, sentence);
                    self.last = Some(seq);
                    self.answered(seq)?;
                }
            }
        }
        Ok(any)
    }

    fn examine(&mut self, item: &Item, read_ns: i64) {
        let seq = item.seq;
        self.findings.checked(Rule::OneForOne);
        if let Some(last) = self.last.filter(|last| seq != last + 1) {
            let reason = match seq > last {
                true => format!("{} is missing", last + 1),
                false => "it is a duplicate or out of order".to_owned(),
            };
            let sentence = format!("it sent item {seq} after item {last}: {reason}");
            self.findings.broken(Rule::OneForOne, sentence);
        }
        self.last = Some(seq);
        self.examine_copy(item);
        if !item.is(flag::END) {
            // The poses of an earlier life are sent with its stamps.
            let is_first = !self.has(seq);
            let sent_ns = self.sent_ns.get(&seq).copied().filter(|_| is_first);
            self.findings.checked(Rule::StampsWork);
            if let Some(sentence) = wrong_stamps(self.stage(), item, sent_ns, read_ns) {
                self.findings.broken(Rule::StampsWork, sentence);
            }
        }
    }

    fn examine_copy(&mut self, item: &Item) {
        let (stage, seq) = (self.stage(), item.seq);
        let Some(copied) = self.harness.topics.copied() else {
            return;
        };
        let Some(input) = self.reference.get(copied, seq).map(Recorded::item) else {
            let sentence = format!("it sent item {seq}, which no input has");
            return self.findings.broken(Rule::OneForOne, sentence);
        };
        self.findings.checked(Rule::CopiesItem);
        for field in not_copied(stage, &input, item) {
            let sentence = format!("item {seq}: {field} differs from the input on `{copied}`");
            self.findings.broken(Rule::CopiesItem, sentence);
        }
    }

    pub(crate) fn kill(&mut self) -> Result<(), Failure> {
        let process = self.harness.process.take();
        process.map_or(Ok(()), Process::kill)?;
        self.receive()?;
        Ok(self.harness.rig.remove_dead()?)
    }

    /// Waits for the end of the process; `None` if it does not end in time.
    pub(crate) fn ended_within(&mut self, limit: Duration) -> Result<Option<Death>, Failure> {
        let since = Instant::now();
        Ok(match self.wait(limit, |_| since.elapsed() >= limit)? {
            Waited::Died(death) => Some(death),
            Waited::Done | Waited::TimedOut => None,
        })
    }

    /// Returns the topics that the process has subscribed to without notifying their publishers.
    pub(crate) fn not_notified(&self) -> Vec<&'static str> {
        let inputs = self.harness.topics.inputs();
        inputs
            .filter(|it| self.is_read(it) && !self.notified.contains(it))
            .collect()
    }

    pub(crate) fn has_joined(&self) -> bool {
        let mut inputs = self.harness.topics.inputs();
        inputs.any(|it| self.is_read(it)) || self.harness.has_publisher()
    }

    pub(crate) fn not_read(&self) -> Vec<&'static str> {
        let inputs = self.harness.topics.forward.iter().copied();
        inputs.filter(|it| !self.is_read(it)).collect()
    }

    fn is_read(&self, topic: &str) -> bool {
        self.harness.rig.subscribers(topic) > 0
    }

    pub(crate) fn about(&self, seq: u64) -> impl Iterator<Item = &Recorded> {
        let items = self.outputs.iter();
        items.filter(move |it| it.item().seq == seq && !it.item().is(flag::BASE))
    }

    pub(crate) fn has(&self, seq: u64) -> bool {
        self.about(seq).next().is_some()
    }

    /// Returns the time from when an item was first sent to when the first answer to it was read,
    /// ns.
    pub(crate) fn answer_ns(&self, seq: u64) -> Option<i64> {
        let (sent_ns, answer) = (self.sent_ns.get(&seq)?, self.about(seq).next()?);
        Some(answer.received_ns.saturating_sub(*sent_ns))
    }

    /// Notes each output from a place on whose bytes differ from the first scenario.
    pub(crate) fn compare(
        &mut self,
        outputs: RangeFrom<usize>,
        rule: Rule,
        when: &str,
    ) -> Result<(), RunError> {
        self.findings.checked(rule);
        for output in &self.outputs[outputs] {
            let item = output.item();
            let bytes = result_bytes(self.harness.topics.output, output)?;
            let first = self.findings.first_results.get(&item.seq);
            if first.is_some_and(|first| *first != bytes) && !item.is(flag::BASE) {
                let sentence = format!("item {} has other bytes {when}", item.seq);
                self.findings.broken(rule, sentence);
            }
        }
        Ok(())
    }
}

/// The messages that are fed to the process: its inputs as they are admitted, and the feedback of
/// the rest of the run to its answers.
impl Session<'_> {
    /// Sends the feedback of the rest of the run to an item.
    fn answered(&mut self, seq: u64) -> Result<(), RunError> {
        if self.newest.is_some_and(|newest| seq <= newest) || self.pace == Pace::Hold {
            return Ok(());
        }
        let first = self.newest.map_or(0, |newest| newest + 1);
        self.newest = Some(seq);
        for seq in first..=seq.min(self.reference.end()) {
            self.feed(&self.harness.topics.feedback, seq)?;
        }
        Ok(())
    }

    pub(crate) fn admit(&mut self) -> Result<(), RunError> {
        let last = self.reference.end().min(self.until.saturating_sub(1));
        while self.next <= last && self.is_admitted(self.next) {
            self.send_inputs(self.next)?;
        }
        Ok(())
    }

    fn is_admitted(&self, seq: u64) -> bool {
        match self.pace {
            Pace::Window => self.harness.rig.manifest().window.admits(seq, self.newest),
            Pace::Single => seq <= self.newest.map_or(0, |newest| newest + 1),
            Pace::Hold => false,
        }
    }

    pub(crate) fn send_inputs(&mut self, seq: u64) -> Result<(), RunError> {
        if self.harness.topics.copied().is_some() {
            self.sent_ns.entry(seq).or_insert_with(clock::now_ns);
        }
        self.feed(&self.harness.topics.forward, seq)?;
        self.next = seq + 1;
        Ok(())
    }

    pub(crate) fn feed(&self, topics: &[&'static str], seq: u64) -> Result<(), RunError> {
        for topic in topics {
            if let Some(message) = self.reference.get(topic, seq) {
                self.harness.feed(topic, message)?;
            }
        }
        Ok(())
    }

    /// Publishes the inputs again as after a restart of all stages: the last poses, and of the
    /// items so far only those that a restarted stage may need. Those after them follow as they are
    /// admitted.
    pub(crate) fn restart_inputs(&mut self, newest_pose: u64) -> Result<(), RunError> {
        self.harness.open_feeds()?;
        self.republish_poses(newest_pose)?;
        let look_back = self.harness.rig.manifest().window.look_back as u64;
        self.newest = Some(newest_pose);
        self.next = (newest_pose + 1).saturating_sub(look_back);
        Ok(())
    }

    fn republish_poses(&mut self, newest: u64) -> Result<(), RunError> {
        let history = Pose::sizes(&self.harness.rig.manifest().window).history as u64;
        for seq in (newest + 1).saturating_sub(history)..=newest {
            let Some(pose) = self.reference.get(Pose::TOPIC, seq) else {
                continue;
            };
            let mut item = pose.item();
            if seq < newest {
                item.flags &= !flag::SYNC;
            }
            self.harness.feed(Pose::TOPIC, &pose.about(&item))?;
        }
        Ok(())
    }
}
