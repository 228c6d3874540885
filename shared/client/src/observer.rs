//! Observers: subscribers that the run does not depend on, in processes of their own. They may
//! attach, be slow, be stopped or be killed at any time: a full queue loses its oldest message, and
//! the observer counts those that it has missed. It holds one message at a time, and notifies the
//! publisher once, when it attaches. The supervisor frees the places of killed observers.

mod sequence;
#[cfg(test)]
mod tests;

use std::{
    fs::File,
    path::Path,
    process, thread,
    time::{Duration, Instant},
};

use gyre_contract::{GivenAnew, Item, Message, NumberedBy, Sender, Topic};

use gyre_transport::{
    AnyMessage, Listener, Manifest, RecordedMessage, RunError, generation,
    heartbeat::HeartbeatWriter,
    numbers::{self, Numbers},
    reader::{self, Port, Received, Subscriber},
    run,
    sessions::not_running,
    transport::{self, Node, Service},
    wake::{self, Signals},
};
pub use sequence::Sequence;

/// The name of the nodes and the subscribers of observers. The observers of a topic are counted by
/// this name.
pub const NAME: &str = "observer";
/// Time to wait for a place. The supervisor frees the places of killed observers within a second or
/// two.
const MAX_WAIT_FOR_PLACE: Duration = Duration::from_secs(5);
/// The shortest time between two looks at a queue that was empty. On a machine whose processors are
/// all busy each wake-up takes time from the stages; at hundreds of messages in a second that is
/// more than what most observers do with them. The queue holds 9 meanwhile.
const REST: Duration = Duration::from_millis(10);
/// The file in the run's root where the recorder writes its process and the number of missed
/// messages.
const MISSED: &str = "recorder.missed";
const RETRY: Duration = Duration::from_millis(100);

/// A running run, seen from outside.
pub struct ObservedRun {
    manifest: Manifest,
    /// The manifest's file. The run has ended when it is deleted.
    file: File,
    node: Node,
}

pub struct Observer<'run, M> {
    run: &'run ObservedRun,
    port: Port<M>,
    current: Option<Received<M>>,
    sequence: Sequence,
    /// True if the last call of [`next`](Self::next) found the end. After the end of the stream
    /// masking may still be killed, and reuse numbers.
    has_ended: bool,
    looked: Instant,
}

/// An observer of a topic that is known by its name, whose messages are taken as bytes.
pub type TopicObserver<'run> = Observer<'run, AnyMessage>;

pub enum Next<'a, M> {
    /// A message, and the number of items that were missed directly before it. If masking was
    /// started again in live mode, it may have a number that was received before: see
    /// [`Item::generation`](gyre_contract::Item).
    Message(&'a Received<M>, u64),
    Idle,
    Ended,
}

impl ObservedRun {
    /// Attaches to the run that writes its results to `out`.
    pub fn writing_to(out: &Path) -> Result<Self, RunError> {
        let absolute = out.canonicalize().unwrap_or_else(|_| out.to_owned());
        let root = run::root_of(&absolute);
        // A run that waits for its radar has none yet.
        if !Manifest::path(&root).exists() {
            return Err(not_running(out.to_owned()));
        }
        Self::at(&root)
    }

    /// Attaches to the run with this root, the value of [`run::ENVIRONMENT`] in its processes.
    pub fn at(root: &Path) -> Result<Self, RunError> {
        transport::silence();
        let manifest = Manifest::read(root)?;
        let path = Manifest::path(root);
        let file = File::open(&path).map_err(RunError::file(&path))?;
        let node = manifest.transport()?.join(NAME)?;
        let run = Self {
            manifest,
            file,
            node,
        };
        match run.has_ended() {
            true => Err(not_running(run.manifest.out)),
            false => Ok(run),
        }
    }

    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// Informs the supervisor, which has started this process as its recorder under this name, that
    /// all topics are observed, and reports the waits for `signals` from here on.
    pub fn is_ready(&self, name: &str, signals: &Signals) -> Result<(), RunError> {
        signals.report_to(HeartbeatWriter::create(&self.manifest, name)?);
        run::write(run::ready_file(&self.manifest.root, name), "")
    }

    /// Reports to the supervisor how many messages its recorder, this process, has missed so far.
    pub fn tell_missed(&self, missed: u64) -> Result<(), RunError> {
        let mut file = Numbers::open(&self.manifest, MISSED)?;
        file.write([process::id().into(), missed])
    }

    pub fn has_ended(&self) -> bool {
        rustix::fs::fstat(&self.file).is_ok_and(|file| file.st_nlink == 0)
    }

    /// Subscribes to a topic. The first messages come from the publisher's history.
    pub fn observe<M: Message>(&self) -> Result<Observer<'_, M>, RunError> {
        self.attach(M::ENTRY)
    }

    /// Subscribes to a topic whose messages are taken as bytes.
    pub fn observe_topic(&self, topic: &'static Topic) -> Result<TopicObserver<'_>, RunError> {
        self.attach(topic)
    }

    fn attach<M>(&self, topic: &'static Topic) -> Result<Observer<'_, M>, RunError> {
        if let Sender::Follower(follower) = topic.sender
            && !follower.is_in(&self.manifest.window)
        {
            return Err(RunError::Input(format!(
                "the run that writes to {} has no topic `{}`: only a run with {} has it",
                self.manifest.out.display(),
                topic.name,
                follower.needs()
            )));
        }
        let deadline = Instant::now() + MAX_WAIT_FOR_PLACE;
        loop {
            let failed = match self.try_attach(topic) {
                Ok(port) => {
                    return Ok(Observer {
                        run: self,
                        port,
                        current: None,
                        sequence: Sequence::default(),
                        has_ended: false,
                        looked: Instant::now(),
                    });
                }
                Err(_) if self.has_ended() => {
                    return Err(not_running(self.manifest.out.clone()));
                }
                Err(error) => error,
            };
            if Instant::now() >= deadline || self.manifest.window.observers == 0 {
                return Err(failed);
            }
            thread::sleep(RETRY);
        }
    }

    pub(crate) fn try_attach<M>(&self, topic: &'static Topic) -> Result<Port<M>, RunError> {
        let places = self.manifest.window.observers;
        let no_place = || RunError::NoPlace {
            topic: topic.name,
            observers: places,
        };
        let service = Service::open(&self.node, topic)?;
        if service.subscribers_named(NAME) >= places {
            return Err(no_place());
        }
        let subscriber = Subscriber::create(&service, Some(NAME))?;
        // Another observer may have come at the same time. The places of the stages must stay free
        // for their restarts.
        if service.subscribers_named(NAME) > places {
            return Err(no_place());
        }
        let port = Port::of(subscriber, topic, &self.node, &self.manifest)?;
        reader::notify_publisher(&self.node, topic.name)?;
        Ok(port)
    }
}

/// Returns the number of missed messages that the recorder, this process, has reported; 0 without a
/// report.
pub fn read_missed(root: &Path, recorder: u32) -> u64 {
    match numbers::read(&root.join(MISSED)) {
        Some([process, missed]) if process == u64::from(recorder) => missed,
        // The recorder before has left its own.
        _ => 0,
    }
}

impl<M> Observer<'_, M> {
    /// Returns the next message in the publisher's memory, and waits for it at most `limit`. The
    /// message before it is released, and the next call releases this one.
    pub fn next(&mut self, limit: Duration) -> Result<Next<'_, M>, RunError> {
        self.current = None;
        self.has_ended = false;
        let since = Instant::now();
        loop {
            while let Some(message) = self.port.receive()? {
                let item = message.item();
                let skipped = self.skipped(self.sequence.generation, item)?;
                if let Some(missed) = self.sequence.advance_past(item, skipped) {
                    return Ok(Next::Message(self.current.insert(message), missed));
                }
            }
            self.has_ended = self.sequence.ended || self.run.has_ended();
            if self.has_ended {
                return Ok(Next::Ended);
            }
            let left = limit.saturating_sub(since.elapsed());
            if left.is_zero() {
                return Ok(Next::Idle);
            }
            self.sleep(left.min(wake::MAX_WAIT))?;
        }
    }

    /// Takes a copy of the next message that is there; `None` without a message. A message that
    /// breaks its contract is an error and counts as missed.
    pub fn take(&mut self) -> Result<Option<RecordedMessage>, RunError> {
        Ok(match self.next(Duration::ZERO)? {
            Next::Message(message, _) => Some(message.to_bytes()),
            Next::Idle | Next::Ended => None,
        })
    }

    /// Returns, among the generations after `known` and before the item's, the one that reused the
    /// smallest number.
    pub fn skipped(&self, known: u32, item: &Item) -> Result<Option<GivenAnew>, RunError> {
        let out = &self.run.manifest.out;
        generation::skipped(out, NumberedBy::of(self.topic()), known, item)
    }

    pub fn topic(&self) -> &'static str {
        self.port.topic.name
    }

    /// Returns whether the last look has found the end of the stream or of the run.
    pub fn has_ended(&self) -> bool {
        self.has_ended
    }

    pub fn listener(&self) -> &Listener {
        self.port.listener()
    }

    /// Counts as missed all items between `next` and the first received item: all before it is
    /// known already, as from an observer that was there earlier, whose newest item had this
    /// generation.
    pub fn expect(&mut self, next: u64, generation: u32) {
        self.sequence.expected = Some(next);
        self.sequence.generation = generation;
    }

    /// Returns the number of items missed since the observer attached, or since the expected item.
    pub fn missed(&self) -> u64 {
        self.sequence.missed
    }

    /// Sleeps until the publisher notifies, and on until [`REST`] has passed since the last look.
    fn sleep(&mut self, limit: Duration) -> Result<(), RunError> {
        let since = Instant::now();
        wake::wait_for(self.port.listener(), limit)?;
        let left = limit.saturating_sub(since.elapsed());
        thread::sleep(REST.saturating_sub(self.looked.elapsed()).min(left));
        self.looked = Instant::now();
        Ok(())
    }
}

/// Sleeps until one of several observers may have a message, a signal requests a stop (then true),
/// or `limit` has passed, and on for as long as an observer rests between two looks.
pub fn wait_for_any(
    signals: &Signals,
    listeners: &[&Listener],
    limit: Duration,
) -> Result<bool, RunError> {
    let woken = signals.wait(listeners, None, limit)?;
    if woken.stop {
        return Ok(true);
    }
    signals.sleep(REST)
}
