//! The messages of a topic that can be sent, from any number on.

use std::{
    collections::VecDeque,
    path::Path,
    sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError},
    time::{Duration, Instant},
};

use gyre_client::{RecordedMessage, RunError};
use gyre_contract::{Hop, MotionHeader, PoseHeader, StageId, flag};
use gyre_journal::{self as journal, loops::LoggedLoops};

/// A message on its way: the bytes of its header, then the bytes of its payload.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) struct Message {
    pub seq: u64,
    /// See [`Item::generation`](gyre_contract::Item::generation).
    pub generation: u32,
    pub bytes: Arc<[u8]>,
}

impl Message {
    pub fn of(message: &RecordedMessage) -> Self {
        let item = message.item().unwrap_or_default();
        Self {
            seq: item.seq,
            generation: item.generation,
            bytes: [&message.header[..], &message.payload].concat().into(),
        }
    }
}

/// The place behind the messages that a receiver has.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Place {
    pub seq: u64,
    /// The generation of the newest one: messages of a later generation are wanted whatever their
    /// numbers. `None`: no number is given twice.
    pub generation: Option<u32>,
}

impl Place {
    pub fn pass(&mut self, message: &Message) {
        self.seq = message.seq.saturating_add(1);
        self.generation = self.generation.map(|_| message.generation);
    }

    fn is_behind(&self, message: &Message) -> bool {
        let is_later = |known| message.generation > known;
        message.seq < self.seq && !self.generation.is_some_and(is_later)
    }
}

#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Next {
    Message(Message),
    Nothing,
    Ended,
}

pub(crate) trait ReplayBuffer: Send + Sync {
    /// Returns the first message from a place on, and waits for it at most `limit`.
    fn next(&self, place: Place, limit: Duration) -> Result<Next, RunError>;

    fn add(&self, message: &RecordedMessage);

    fn end(&self) -> Result<(), RunError>;
}

pub(crate) struct MemoryBuffer {
    held: Mutex<Held>,
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

impl MemoryBuffer {
    pub fn of(messages: usize) -> Self {
        Self::bounded(messages, usize::MAX)
    }

    /// Creates a buffer of at most so many messages and bytes, but at least the newest message.
    pub fn bounded(messages: usize, bytes: usize) -> Self {
        Self {
            held: Mutex::default(),
            changed: Condvar::new(),
            max_messages: messages,
            max_bytes: bytes,
        }
    }
}

impl ReplayBuffer for MemoryBuffer {
    fn next(&self, place: Place, limit: Duration) -> Result<Next, RunError> {
        let first = |held: &Held| {
            let has = |message: &Message| place.is_behind(message);
            let at = held.messages.partition_point(has);
            let message = held.messages.get(at).cloned().map(Next::Message);
            message.or(held.has_ended.then_some(Next::Ended))
        };
        Ok(wait(&self.held, &self.changed, limit, first).unwrap_or(Next::Nothing))
    }

    fn add(&self, message: &RecordedMessage) {
        let item = message.item().unwrap_or_default();
        let message = Message::of(message);
        let held = &mut *lock(&self.held);
        // Masking was restarted and numbers again, perhaps including numbers that did not arrive.
        let is_void = |last: &mut Message| {
            let is_earlier = last.generation < message.generation;
            last.seq >= message.seq || is_earlier && last.seq >= item.numbered_from
        };
        while let Some(void) = held.messages.pop_back_if(is_void) {
            held.bytes -= void.bytes.len();
        }
        held.bytes += message.bytes.len();
        held.messages.push_back(message);
        while held.messages.len() > 1
            && (held.messages.len() > self.max_messages || held.bytes > self.max_bytes)
        {
            held.bytes -= held.messages.pop_front().map_or(0, |it| it.bytes.len());
        }
        self.changed.notify_all();
    }

    fn end(&self) -> Result<(), RunError> {
        lock(&self.held).has_ended = true;
        self.changed.notify_all();
        Ok(())
    }
}

/// The messages in a log of a run: all of them, however long the receiver was away.
pub(crate) struct LogBuffer {
    read: Mutex<ReadLog>,
    published: Mutex<Published>,
    changed: Condvar,
}

/// Returns the header of a message in a log by its number, if it is there.
type ReadLog = Box<dyn FnMut(u64) -> Result<Option<Vec<u8>>, RunError> + Send>;

#[derive(Clone, Copy, Default)]
struct Published {
    messages: u64,
    has_ended: bool,
}

impl LogBuffer {
    fn of(read: ReadLog) -> Self {
        Self {
            read: Mutex::new(read),
            published: Mutex::default(),
            changed: Condvar::new(),
        }
    }

    pub fn of_poses(out: &Path) -> Self {
        let out = out.to_owned();
        Self::of(Box::new(move |seq| {
            let mut poses = journal::poses_from(&out, seq).map_err(RunError::input)?;
            let pose = poses.next().transpose().map_err(RunError::input)?;
            let pose = pose.filter(|pose| !pose.item.is(flag::END));
            Ok(pose.map(|pose| bytemuck::bytes_of(&pose).to_vec()))
        }))
    }

    pub fn of_loops(mut log: LoggedLoops) -> Self {
        Self::of(Box::new(move |seq| {
            let loops = log.refresh()?;
            let found = loops.get(seq as usize);
            Ok(found.map(|found| bytemuck::bytes_of(found).to_vec()))
        }))
    }

    pub fn set_published(&self, messages: u64) {
        lock(&self.published).messages = messages;
        self.changed.notify_all();
    }

    fn read(&self, seq: u64) -> Result<Option<Vec<u8>>, RunError> {
        (lock(&self.read))(seq)
    }
}

impl ReplayBuffer for LogBuffer {
    fn next(&self, place: Place, limit: Duration) -> Result<Next, RunError> {
        let seq = place.seq;
        let is_decided =
            |it: &Published| (seq < it.messages || it.has_ended).then_some(it.messages);
        let Some(published) = wait(&self.published, &self.changed, limit, is_decided) else {
            return Ok(Next::Nothing);
        };
        if seq >= published {
            return Ok(Next::Ended);
        }
        let message = |bytes: Vec<u8>| {
            Next::Message(Message {
                seq,
                // A message in a log is never void.
                generation: 0,
                bytes: bytes.into(),
            })
        };
        Ok(self.read(seq)?.map_or(Next::Nothing, message))
    }

    fn add(&self, message: &RecordedMessage) {
        self.set_published(message.item().map_or(0, |item| item.seq.saturating_add(1)));
    }

    fn end(&self) -> Result<(), RunError> {
        let mut messages = lock(&self.published).messages;
        while self.read(messages)?.is_some() {
            messages += 1;
        }
        *lock(&self.published) = Published {
            messages,
            has_ended: true,
        };
        self.changed.notify_all();
        Ok(())
    }
}

/// The motions of the poses in a journal, as in the topic that poses are composed from. They come
/// and end with the poses.
pub(crate) struct MotionBuffer(pub Arc<LogBuffer>);

impl ReplayBuffer for MotionBuffer {
    fn next(&self, place: Place, limit: Duration) -> Result<Next, RunError> {
        let mut next = self.0.next(place, limit)?;
        if let Next::Message(message) = &mut next {
            let PoseHeader { item, motion, .. } = bytemuck::pod_read_unaligned(&message.bytes);
            let mut motion = MotionHeader { item, motion };
            *motion.item.hop_mut(StageId::PoseIntegration) = Hop::default();
            message.bytes = bytemuck::bytes_of(&motion).into();
        }
        Ok(next)
    }

    fn add(&self, _: &RecordedMessage) {}

    fn end(&self) -> Result<(), RunError> {
        Ok(())
    }
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // A thread that panicked had only read.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

fn wait<T, U>(
    mutex: &Mutex<T>,
    changed: &Condvar,
    limit: Duration,
    find: impl Fn(&T) -> Option<U>,
) -> Option<U> {
    let deadline = Instant::now() + limit;
    let mut guard = lock(mutex);
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        match find(&guard) {
            None if !left.is_zero() => {}
            found => return found,
        }
        let waited = changed.wait_timeout(guard, left);
        guard = waited.unwrap_or_else(PoisonError::into_inner).0;
    }
}
