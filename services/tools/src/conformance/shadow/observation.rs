//! The observed items of the run: the inputs of the stage, and its output.

use std::collections::{BTreeMap, VecDeque};

use gyre_client::{Listener, Run, RunError, TopicObserver};
use gyre_contract::{StageId, StageTopics, flag};
use gyre_supervise::rig::Recorded;

/// Items that are not complete. Beyond them the oldest is given up: in live mode most scans never
/// become an item.
const MAX_INCOMPLETE: usize = 64;

#[derive(Clone, Debug)]
pub(crate) struct Observed {
    /// The inputs that lead down the stream, by topic.
    pub inputs: Vec<(&'static str, Recorded)>,
    pub output: Recorded,
    /// For masking: the feedback to the items before, without a gap, as far back as it may need.
    pub before: Vec<Feedback>,
    /// True if a stage that begins here can give the result of one that has seen all before.
    pub can_open: bool,
}

#[derive(Clone, Debug)]
pub(crate) struct Feedback {
    pub motion: Recorded,
    pub pose: Recorded,
}

impl Observed {
    pub(crate) fn seq(&self) -> u64 {
        self.output.item().seq
    }

    pub(crate) fn breaks(&self) -> bool {
        self.output.item().is(flag::BREAK)
    }
}

pub(crate) struct Observation<'run> {
    run: &'run Run,
    /// The inputs, the output, then the feedback.
    topics: Vec<&'static str>,
    observers: Vec<TopicObserver>,
    forward: usize,
    lag: u64,
    /// The messages of incomplete items, by the number of the scan at its source, because masking
    /// renumbers scans.
    incomplete: BTreeMap<u64, Vec<Option<Recorded>>>,
    /// The last items without a gap: those that the lag reaches from an item and from the one
    /// before.
    recent: VecDeque<Feedback>,
    last: Option<u64>,
    /// Items of the stage that were not seen whole.
    pub missed: u64,
    pub gaps: u64,
}

impl<'run> Observation<'run> {
    pub(crate) fn of(
        run: &'run Run,
        stage: StageId,
        stage_topics: &StageTopics,
    ) -> Result<Self, RunError> {
        let mut topics = stage_topics.forward.clone();
        topics.push(stage_topics.output);
        if stage == StageId::Masking {
            topics.extend(&stage_topics.feedback);
        }
        let mut observers = Vec::new();
        for topic in &topics {
            observers.extend(
                gyre_contract::topic(topic)
                    .map(|it| run.observe_topic(it))
                    .transpose()?,
            );
        }
        Ok(Self {
            run,
            observers,
            topics,
            forward: stage_topics.forward.len(),
            lag: run.manifest().window.lag as u64,
            incomplete: BTreeMap::new(),
            recent: VecDeque::new(),
            last: None,
            missed: 0,
            gaps: 0,
        })
    }

    /// Empties the queues; returns the items that are complete with it.
    pub(crate) fn take(&mut self) -> Result<Vec<Observed>, RunError> {
        let mut complete = Vec::new();
        for place in 0..self.observers.len() {
            loop {
                match self.observers[place].take() {
                    Ok(Some(message)) => {
                        let message = Recorded {
                            header: message.header,
                            payload: message.payload,
                            received_ns: 0,
                        };
                        complete.extend(self.add(place, message));
                    }
                    Ok(None) => break,
                    // The run judges the messages of its stages. The item counts as missed.
                    Err(RunError::Malformed { .. }) => {}
                    Err(error) => return Err(error),
                }
            }
        }
        Ok(complete)
    }

    pub(crate) fn listeners(&self) -> impl Iterator<Item = &Listener> {
        self.observers.iter().map(|it| it.listener())
    }

    pub(crate) fn has_ended(&self) -> bool {
        self.run.has_ended() || self.observers.iter().all(|it| it.has_ended())
    }

    fn add(&mut self, place: usize, message: Recorded) -> Option<Observed> {
        let published = message.item().published;
        let topics = self.topics.len();
        let messages = self.incomplete.entry(published);
        let messages = messages.or_insert_with(|| vec![None; topics]);
        messages[place] = Some(message);
        if messages.iter().all(Option::is_some) {
            return self.complete(published);
        }
        if self.incomplete.len() > MAX_INCOMPLETE {
            self.incomplete.pop_first();
        }
        None
    }

    fn complete(&mut self, published: u64) -> Option<Observed> {
        // Each topic comes in order: a missing message of an earlier item does not come any more.
        let later = self.incomplete.split_off(&published.saturating_add(1));
        let mut earlier = std::mem::replace(&mut self.incomplete, later);
        let messages: Option<Vec<_>> = earlier.remove(&published)?.into_iter().collect();
        let mut messages = messages?.into_iter();
        let topics = self.topics.iter().copied();
        let inputs: Vec<_> = topics.zip(messages.by_ref().take(self.forward)).collect();
        let output = messages.next()?;
        self.count_missed(output.item().seq);
        let mut observed = Observed {
            inputs,
            output,
            before: Vec::new(),
            can_open: true,
        };
        if let (Some(motion), Some(pose)) = (messages.next(), messages.next()) {
            self.add_feedback(&mut observed);
            self.recent.push_back(Feedback { motion, pose });
            while self.recent.len() as u64 > self.lag + 1 {
                self.recent.pop_front();
            }
        }
        Some(observed)
    }

    fn count_missed(&mut self, seq: u64) {
        let expected = self.last.map_or(seq, |last| last.saturating_add(1));
        if seq != expected {
            self.missed += seq.saturating_sub(expected);
            self.gaps += 1;
            self.recent.clear();
        }
        self.last = Some(seq);
    }

    fn add_feedback(&self, observed: &mut Observed) {
        let (seq, lag) = (observed.seq(), self.lag);
        observed.before = self.recent.iter().cloned().collect();
        let before = &observed.before;
        let has_all = before.len() as u64 > lag;
        // A chain that has just begun is compensated by nothing.
        let mut items = before.iter().map(|it| it.pose.item());
        let begins_before = items.any(|it| it.is(flag::BREAK) && it.seq.saturating_add(lag) > seq);
        observed.can_open = match observed.breaks() {
            true => seq == 0 || has_all,
            false => has_all && !begins_before,
        };
    }
}
