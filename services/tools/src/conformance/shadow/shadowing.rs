//! The loop: takes the items of the run, starts the shadow, sends it item after item, and compares
//! its answers.

use std::{
    collections::VecDeque,
    fmt::Display,
    time::{Duration, Instant},
};

use gyre_client::{Listener, MAX_WAIT, Run, RunError, Signals, clock};
use gyre_configuration::terminal::{Failure, print};
use gyre_contract::{Item, StageId, flag};
use gyre_supervise::rig::Recorded;

use super::{
    Life, ShadowArguments, ShadowProgram,
    observation::{Observation, Observed},
    record::{Record, keep},
    renumbering::{Entry, Renumbering, SentItem},
};
use crate::conformance::{
    harness::Sent,
    result::{not_copied, wrong_stamps},
};

/// Items that wait for the shadow at most; then all but the newest are skipped.
const BACKLOG: usize = 16;
/// The same for a refinement, which cannot skip an item and is restarted instead.
const BACKLOG_OF_REFINEMENT: usize = 128;
/// The shortest time between two polls of the run: see [`gyre_client::observer`].
const REST: Duration = Duration::from_millis(10);
/// The same interval while the shadow starts, because its listeners are not notified.
const STARTING: Duration = Duration::from_millis(5);
/// Time before the shadow is started again.
const BACKOFF: Duration = Duration::from_secs(1);
/// Ends in a row without a compared item after which it is not started again.
const MAX_FAILURES: u64 = 3;

pub(crate) struct Shadowing<'a> {
    arguments: &'a ShadowArguments,
    program: &'a ShadowProgram,
    signals: &'a Signals,
    topic: &'static str,
    observation: Observation<'a>,
    taken: Instant,
    backlog: VecDeque<Observed>,
    life: Option<Life<'a>>,
    renumbering: Renumbering,
    under_way: Option<UnderWay>,
    /// The item before the one under way, which need not be answered.
    unanswerable: Option<u64>,
    /// When the shadow may be started.
    due: Instant,
    /// Ends since the last compared item.
    failures: u64,
    record: Record,
}

struct UnderWay {
    observed: Observed,
    sent: SentItem,
    sent_ns: i64,
    since: Instant,
    /// True if it had the item before, and so nothing else to do.
    is_timed: bool,
}

fn say(line: impl Display) {
    print::note(format_args!("gyre shadow: {line}"));
}

impl<'a> Shadowing<'a> {
    pub(crate) fn begin(
        arguments: &'a ShadowArguments,
        program: &'a ShadowProgram,
        run: &'a Run,
        signals: &'a Signals,
        record: Record,
    ) -> Result<Self, RunError> {
        let now = Instant::now();
        let (stage, topics) = (program.candidate.stage, program.candidate.topics());
        Ok(Self {
            arguments,
            program,
            signals,
            topic: topics.output,
            observation: Observation::of(run, stage, &topics)?,
            taken: now,
            backlog: VecDeque::new(),
            life: None,
            renumbering: Renumbering::new(stage, run.manifest().window.lag),
            under_way: None,
            unanswerable: None,
            due: now,
            failures: 0,
            record,
        })
    }

    /// Runs until the run has ended, enough is compared, or a signal requests a stop.
    pub(crate) fn run(mut self) -> Result<Record, Failure> {
        let program = &self.program.candidate;
        let (command, out) = (program.command.join(" "), program.manifest.out.display());
        let stage = program.stage.name();
        let mut begins = Some(format!("`{command}` beside {stage} of {out}"));
        loop {
            // Before the poll: the messages before the end are still in the queues.
            let has_ended = self.observation.has_ended();
            self.take(has_ended)?;
            self.attend()?;
            // A program that cannot be started is reported by the error alone.
            begins.take().into_iter().for_each(say);
            let scans = self.arguments.scans;
            let has_enough = scans.is_some_and(|scans| self.record.counts.compared >= scans);
            if has_enough || self.is_done(has_ended) || self.sleep()? {
                return self.finish();
            }
        }
    }

    /// Returns whether nothing more can come: the run has ended and all is answered, or the shadow
    /// is given up.
    fn is_done(&self, has_ended: bool) -> bool {
        let has_answered = self.backlog.is_empty() && self.under_way.is_none();
        let is_given_up = self.failures >= MAX_FAILURES;
        let comes_again = self.life.is_some() || self.record.counts.starts == 0;
        is_given_up || (has_ended && (has_answered || !comes_again))
    }

    fn sleep(&self) -> Result<bool, RunError> {
        let rest = REST.saturating_sub(self.taken.elapsed());
        let is_starting = self.life.as_ref().is_some_and(|life| !life.is_open);
        let shadow = self.life.iter().map(|life| life.harness.output.listener());
        let mut listeners: Vec<&Listener> = shadow.collect();
        if !rest.is_zero() {
            return Ok(self.signals.wait(&listeners, None, rest)?.stop);
        }
        listeners.extend(self.observation.listeners());
        let limit = if is_starting { STARTING } else { MAX_WAIT };
        Ok(self.signals.wait(&listeners, None, limit)?.stop)
    }

    fn take(&mut self, at_once: bool) -> Result<(), RunError> {
        if !at_once && self.taken.elapsed() < REST {
            return Ok(());
        }
        self.taken = Instant::now();
        for observed in self.observation.take()? {
            self.record.counts.observed += 1;
            self.backlog.push_back(observed);
        }
        let counts = &mut self.record.counts;
        (counts.missed, counts.gaps) = (self.observation.missed, self.observation.gaps);
        self.bound_backlog()
    }

    fn bound_backlog(&mut self) -> Result<(), RunError> {
        let starts_again =
            self.program.candidate.stage == StageId::Refinement && self.life.is_some();
        let limit = match starts_again {
            true => BACKLOG_OF_REFINEMENT,
            false => BACKLOG,
        };
        if self.backlog.len() <= limit {
            return Ok(());
        }
        let is_open = self.life.as_ref().is_some_and(|life| life.is_open);
        let counts = &mut self.record.counts;
        // One that starts finds the newest ones.
        let (kept, count) = match is_open {
            true => (1, &mut counts.skipped),
            false => (BACKLOG, &mut counts.while_starting),
        };
        let left_out = self.backlog.len().saturating_sub(kept);
        self.backlog.drain(..left_out);
        *count += left_out as u64;
        match starts_again {
            true => self.end_life(Duration::ZERO),
            false => Ok(()),
        }
    }

    fn attend(&mut self) -> Result<(), Failure> {
        let Some(life) = &mut self.life else {
            return self.start();
        };
        let is_open = life.attend()?;
        // Before its messages: a dead program sends no more.
        let death = life.harness.death();
        for sent in life.take()? {
            self.receive(sent)?;
        }
        if let Some(death) = death {
            self.record.counts.deaths += 1;
            return Ok(self.fail(death.to_string())?);
        }
        if let Some(reason) = self.hangs() {
            self.record.counts.hangs += 1;
            return Ok(self.fail(reason)?);
        }
        if is_open {
            self.send()?;
        }
        Ok(())
    }

    fn start(&mut self) -> Result<(), Failure> {
        // A refinement begins with a copy of the state after its first item, which has to be there.
        let waits = self.program.candidate.stage == StageId::Refinement && self.backlog.is_empty();
        if waits || Instant::now() < self.due {
            return Ok(());
        }
        self.record.counts.starts += 1;
        self.renumbering = Renumbering::new(
            self.program.candidate.stage,
            self.program.candidate.manifest.window.lag,
        );
        self.life = Some(Life::begin(self.program, self.signals)?);
        Ok(())
    }

    fn hangs(&self) -> Option<String> {
        let life = self.life.as_ref()?;
        let (start, item_timeout) = (self.arguments.start_timeout_s, self.arguments.patience_s);
        if !life.is_open {
            let topic = self.topic;
            return (life.began.elapsed() > start)
                .then(|| format!("it has not opened `{topic}` within {start:.0?}"));
        }
        let under_way = self.under_way.as_ref()?;
        let seq = under_way.observed.seq();
        (under_way.since.elapsed() > item_timeout)
            .then(|| format!("it has not answered item {seq} within {item_timeout:.0?}"))
    }

    fn fail(&mut self, sentence: String) -> Result<(), RunError> {
        self.failures += 1;
        let again = match self.failures >= MAX_FAILURES {
            true => "it is not started again",
            false => "it is started again",
        };
        say(format_args!("{sentence}; {again}"));
        keep(&mut self.record.ends, sentence);
        self.end_life(BACKOFF)
    }

    fn end_life(&mut self, backoff: Duration) -> Result<(), RunError> {
        self.record.counts.unanswered += u64::from(self.under_way.take().is_some());
        self.unanswerable = None;
        self.due = Instant::now() + backoff;
        match self.life.take() {
            Some(life) => self.program.keep_output(&life),
            None => Ok(()),
        }
    }

    /// Sends the next items: one that has to be answered, and those before it.
    fn send(&mut self) -> Result<(), RunError> {
        while self.under_way.is_none()
            && let Some(observed) = self.backlog.pop_front()
        {
            match self.renumbering.entry(&observed) {
                Entry::Continues | Entry::Opens => {}
                Entry::IsLeftOut => {
                    self.record.counts.opening += 1;
                    continue;
                }
                Entry::NeedsNewLife => {
                    self.backlog.push_front(observed);
                    return self.end_life(Duration::ZERO);
                }
            }
            let Some(life) = &self.life else {
                return Ok(());
            };
            let (sent_ns, since) = (clock::now_ns(), Instant::now());
            let sent = self.renumbering.send(&life.harness, &observed)?;
            if sent.is_answered {
                let is_timed = self.unanswerable.is_none();
                self.under_way = Some(UnderWay {
                    observed,
                    sent,
                    sent_ns,
                    since,
                    is_timed,
                });
            } else {
                self.unanswerable = Some(sent.item.seq);
                self.record.counts.opening += 1;
            }
        }
        Ok(())
    }

    fn finish(mut self) -> Result<Record, Failure> {
        let counts = &mut self.record.counts;
        counts.left += self.backlog.len() as u64 + u64::from(self.under_way.is_some());
        if let Some(mut life) = self.life.take() {
            life.end()?;
            self.program.keep_output(&life)?;
        }
        Ok(self.record)
    }

    fn receive(&mut self, sent: Sent) -> Result<(), Failure> {
        let output = match sent {
            Sent::Message(output) => output,
            Sent::Malformed { sentence, .. } => {
                self.breach(sentence);
                self.record.counts.unanswered += u64::from(self.under_way.take().is_some());
                return Ok(());
            }
        };
        let item = output.item();
        match self.under_way.take() {
            Some(it) if it.sent.item.seq == item.seq && !item.is(flag::END) => {
                self.unanswerable = None;
                return self.answered(&it, &output);
            }
            before => self.under_way = before,
        }
        match self.unanswerable.take() {
            Some(seq) if seq == item.seq && !item.is(flag::END) => {}
            unasked => {
                self.unanswerable = unasked;
                let owed = match &self.under_way {
                    Some(it) => format!("item {}", it.sent.item.seq),
                    None => "none".to_owned(),
                };
                let seq = item.seq;
                self.breach(format!("it sent item {seq}, and {owed} was to be answered"));
            }
        }
        Ok(())
    }

    fn answered(&mut self, it: &UnderWay, output: &Recorded) -> Result<(), Failure> {
        let stage = self.program.candidate.stage;
        let (item, sent) = (output.item(), &it.sent.item);
        for field in not_copied(stage, sent, &item) {
            let seq = it.observed.seq();
            self.breach(format!("item {seq}: {field} is not that of its input"));
        }
        let wrong = wrong_stamps(stage, &item, Some(it.sent_ns), output.received_ns);
        let has_stamps = wrong.is_none();
        wrong.into_iter().for_each(|sentence| self.breach(sentence));
        if it.sent.opens {
            self.record.counts.opening += 1;
            return Ok(());
        }
        self.failures = 0;
        let answered_ns = match has_stamps {
            true => item.hops[stage as usize].published_ns,
            false => output.received_ns,
        };
        let as_observed = Item {
            seq: it.observed.seq(),
            ..item
        };
        let answer_ns = it.is_timed.then_some(answered_ns - it.sent_ns);
        let shadow = output.about(&as_observed);
        self.record.compare(&it.observed.output, &shadow, answer_ns)
    }

    fn breach(&mut self, sentence: String) {
        if self.record.counts.breaches == 0 {
            say(format_args!("it breaks the contract: {sentence}"));
        }
        self.record.breach(sentence);
    }
}
