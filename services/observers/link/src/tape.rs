//! What is kept of a topic to be sent, from a given message on.

use std::{
    collections::VecDeque,
    path::{Path, PathBuf},
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use bytemuck::Pod;
use gyre_journal as journal;
use gyre_loop_closure::LoggedLoops;
use gyre_messages::{Hop, LoopHeader, MotionHeader, PoseHeader, StageId, flag};
use gyre_stage::source::RecordedMessage;

use crate::LinkError;

/// A message on its way: the bytes of its header, then those of its payload.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Message {
    /// Its place in its topic.
    pub seq: u64,
    /// Shared by all receivers.
    pub bytes: Arc<[u8]>,
}

impl Message {
    /// Creates the message to send.
    pub fn of(message: &RecordedMessage) -> Self {
        Self {
            seq: message.item().map_or(0, |item| item.seq),
            bytes: [&message.header[..], &message.payload].concat().into(),
        }
    }
}

/// What follows on a tape.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Next {
    /// A message.
    Message(Message),
    /// Nothing yet.
    Nothing,
    /// Nothing any more.
    Ended,
}

/// The messages of a topic.
pub(crate) trait Tape: Send + Sync {
    /// Returns the first message from number `seq` on, and waits for it at most `limit`.
    fn next(&self, seq: u64, limit: Duration) -> Result<Next, LinkError>;
}

/// The newest messages of a topic, in memory.
pub(crate) struct Ring {
    kept: Mutex<Held>,
    changed: Condvar,
    max_messages: usize,
    max_bytes: usize,
}

#[derive(Default)]
struct Held {
    messages: VecDeque<Message>,
    bytes: usize,
    has_ended: bool,
}

impl Ring {
    /// Keeps at most so many messages.
    pub fn of(messages: usize) -> Self {
        Self::bounded(messages, usize::MAX)
    }

    /// Keeps at most so many messages and bytes, and the newest message in any case.
    pub fn bounded(messages: usize, bytes: usize) -> Self {
        Self {
            kept: Mutex::default(),
            changed: Condvar::new(),
            max_messages: messages,
            max_bytes: bytes,
        }
    }

    /// Adds a message.
    pub fn push(&self, message: Message) {
        let kept = &mut *lock(&self.kept);
        kept.bytes += message.bytes.len();
        kept.messages.push_back(message);
        while kept.messages.len() > 1
            && (kept.messages.len() > self.max_messages || kept.bytes > self.max_bytes)
        {
            kept.bytes -= kept.messages.pop_front().map_or(0, |it| it.bytes.len());
        }
        self.changed.notify_all();
    }

    /// No message follows.
    pub fn end(&self) {
        lock(&self.kept).has_ended = true;
        self.changed.notify_all();
    }
}

impl Tape for Ring {
    fn next(&self, seq: u64, limit: Duration) -> Result<Next, LinkError> {
        let first = |kept: &Held| {
            let at = kept.messages.partition_point(|message| message.seq < seq);
            let message = kept.messages.get(at).cloned().map(Next::Message);
            message.or(kept.has_ended.then_some(Next::Ended))
        };
        Ok(wait(&self.kept, &self.changed, limit, first).unwrap_or(Next::Nothing))
    }
}

/// The messages in a log of a run: all of them, however long nobody has asked.
pub(crate) struct Logged<L> {
    log: Mutex<L>,
    come: Mutex<Come>,
    changed: Condvar,
}

#[derive(Clone, Copy, Default)]
struct Come {
    /// The number of messages that have been published.
    messages: u64,
    has_ended: bool,
}

/// A log on the disk.
pub(crate) trait Log: Send {
    /// What it holds.
    type Header: Pod;

    /// Returns a message by its number, if it is there.
    fn read(&mut self, seq: u64) -> Result<Option<Self::Header>, LinkError>;
}

/// The poses in the journal of a run.
pub(crate) type Poses = Logged<PoseLog>;
/// The loops in the log of a run.
pub(crate) type Loops = Logged<LoggedLoops>;

/// The journal of a run.
pub(crate) struct PoseLog(PathBuf);

impl PoseLog {
    /// Reads the journal of the run that writes to `out`.
    pub fn of(out: &Path) -> Self {
        Self(journal::path(out))
    }
}

impl Log for PoseLog {
    type Header = PoseHeader;

    fn read(&mut self, seq: u64) -> Result<Option<PoseHeader>, LinkError> {
        let Some(mut records) = journal::records_from(&self.0, seq)? else {
            return Ok(None);
        };
        let pose = records.next().transpose()?;
        Ok(pose.filter(|pose| !pose.item.is(flag::END)))
    }
}

impl Log for LoggedLoops {
    type Header = LoopHeader;

    fn read(&mut self, seq: u64) -> Result<Option<LoopHeader>, LinkError> {
        let loops = self.refresh()?;
        Ok(loops.get(seq as usize).copied())
    }
}

impl<L: Log> Logged<L> {
    /// Sends from this log what has been published.
    pub fn of(log: L) -> Self {
        Self {
            log: Mutex::new(log),
            come: Mutex::default(),
            changed: Condvar::new(),
        }
    }

    /// So many messages have been published.
    pub fn have_come(&self, messages: u64) {
        lock(&self.come).messages = messages;
        self.changed.notify_all();
    }

    /// No message follows those of the log.
    pub fn end(&self) -> Result<(), LinkError> {
        let mut messages = lock(&self.come).messages;
        while self.read(messages)?.is_some() {
            messages += 1;
        }
        *lock(&self.come) = Come {
            messages,
            has_ended: true,
        };
        self.changed.notify_all();
        Ok(())
    }

    /// Returns a message of the log.
    pub fn read(&self, seq: u64) -> Result<Option<L::Header>, LinkError> {
        lock(&self.log).read(seq)
    }

    /// Returns what is to be sent of message `seq`.
    fn next_as<H: Pod>(
        &self,
        seq: u64,
        limit: Duration,
        header: impl Fn(L::Header) -> H,
    ) -> Result<Next, LinkError> {
        let has_come = |come: &Come| (seq < come.messages || come.has_ended).then_some(*come);
        let Some(come) = wait(&self.come, &self.changed, limit, has_come) else {
            return Ok(Next::Nothing);
        };
        if seq >= come.messages {
            return Ok(Next::Ended);
        }
        let message = |found| {
            Next::Message(Message {
                seq,
                bytes: bytemuck::bytes_of(&header(found)).into(),
            })
        };
        Ok(self.read(seq)?.map_or(Next::Nothing, message))
    }
}

impl<L: Log> Tape for Logged<L> {
    fn next(&self, seq: u64, limit: Duration) -> Result<Next, LinkError> {
        self.next_as(seq, limit, |header| header)
    }
}

/// The motions of the poses in a journal, as the topic has them from which poses are composed.
pub(crate) struct Motions(pub Arc<Poses>);

impl Tape for Motions {
    fn next(&self, seq: u64, limit: Duration) -> Result<Next, LinkError> {
        self.0.next_as(seq, limit, |pose| {
            let mut motion = MotionHeader {
                item: pose.item,
                motion: pose.motion,
            };
            *motion.item.hop_mut(StageId::PoseIntegration) = Hop::default();
            motion
        })
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // A thread that panicked had only read.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Waits until there is what is looked for, at most `limit`.
fn wait<T, U>(
    mutex: &Mutex<T>,
    changed: &Condvar,
    limit: Duration,
    look: impl Fn(&T) -> Option<U>,
) -> Option<U> {
    let deadline = Instant::now() + limit;
    let mut guard = lock(mutex);
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        match look(&guard) {
            None if !left.is_zero() => {}
            found => return found,
        }
        let waited = changed.wait_timeout(guard, left);
        guard = waited.unwrap_or_else(PoisonError::into_inner).0;
    }
}
