//! Observers: subscribers that the run does not depend on, in processes of their own. They may
//! attach, be slow, be stopped or be killed at any time: a full queue loses its oldest message, and
//! the observer counts those that it has missed. It holds one message at a time, and notifies the
//! publisher once, when it attaches. The supervisor frees the places of killed observers.

mod sequence;
#[cfg(test)]
mod tests;

use std::{
    fs::File,
    ops::Deref,
    path::Path,
    process,
    rc::Rc,
    thread,
    time::{Duration, Instant},
};

use gyre_contract::{self as contract, GivenAnew, Item, NumberedBy, Sender, Topic};

use crate::control::Control;
use gyre_transport::{
    AnyMessage, Listener, Manifest, RecordedMessage, RunError, generation,
    heartbeat::HeartbeatWriter,
    numbers::{self, Numbers},
    reader::{self, Port, Received},
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

/// A running run, seen from outside. A clone is the same run.
#[derive(Clone)]
pub struct Run(Rc<Attached>);

struct Attached {
    manifest: Manifest,
    /// The manifest's file. The run has ended when it is deleted.
    file: File,
    node: Node,
}

pub struct Observer<M> {
    run: Run,
    port: Port<M>,
    current: Option<Received<M>>,
    sequence: Sequence,
    /// True if the last call of [`next`](Self::next) found the end. After the end of the stream
    /// masking may still be killed, and reuse numbers.
    has_ended: bool,
    looked: Instant,
    /// Shared with the message that [`Messages`] has returned.
    held: Rc<()>,
}

/// An observer of a topic that is known by its name, whose messages are taken as bytes.
pub type TopicObserver = Observer<AnyMessage>;

pub enum Next<'a, M> {
    /// A message, and the number of items that were missed directly before it. If masking was
    /// started again in live mode, it may have a number that was received before: see
    /// [`Item::generation`](gyre_contract::Item).
    Message(&'a Received<M>, u64),
    Idle,
    Ended,
}

impl Run {
    /// Attaches to the run that writes its results to `out`.
    pub fn open(out: impl AsRef<Path>) -> Result<Self, RunError> {
        let out = out.as_ref();
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
        let run = Self(Rc::new(Attached {
            manifest,
            file,
            node,
        }));
        match run.has_ended() {
            true => Err(not_running(run.manifest().out.clone())),
            false => Ok(run),
        }
    }

    /// Attaches to the only run of this user.
    pub fn only() -> Result<Self, RunError> {
        Self::open(Control::only()?.out())
    }

    /// Returns what controls the run: its status, and requests to its supervisor.
    pub fn control(&self) -> Result<Control, RunError> {
        Control::of(&self.manifest().out)
    }

    pub fn manifest(&self) -> &Manifest {
        &self.0.manifest
    }

    /// Informs the supervisor, which has started this process as its recorder under this name, that
    /// all topics are observed, and reports the waits for `signals` from here on.
    pub fn is_ready(&self, name: &str, signals: &Signals) -> Result<(), RunError> {
        signals.report_to(HeartbeatWriter::create(&self.0.manifest, name)?);
        run::write(run::ready_file(&self.0.manifest.root, name), "")
    }

    /// Reports to the supervisor how many messages its recorder, this process, has missed so far.
    pub fn tell_missed(&self, missed: u64) -> Result<(), RunError> {
        let mut file = Numbers::open(&self.0.manifest, MISSED)?;
        file.write([process::id().into(), missed])
    }

    pub fn has_ended(&self) -> bool {
        rustix::fs::fstat(&self.0.file).is_ok_and(|file| file.st_nlink == 0)
    }

    /// Subscribes to a topic. The first messages come from the publisher's history.
    pub fn observe<M: contract::Message>(&self) -> Result<Observer<M>, RunError> {
        self.attach(M::ENTRY)
    }

    /// Subscribes to a topic whose messages are taken as bytes.
    pub fn observe_topic(&self, topic: &'static Topic) -> Result<TopicObserver, RunError> {
        self.attach(topic)
    }

    fn attach<M>(&self, topic: &'static Topic) -> Result<Observer<M>, RunError> {
        if let Sender::Follower(follower) = topic.sender
            && !follower.is_in(&self.0.manifest.window)
        {
            return Err(RunError::Input(format!(
                "the run that writes to {} has no topic `{}`: only a run with {} has it",
                self.0.manifest.out.display(),
                topic.name,
                follower.needs()
            )));
        }
        let deadline = Instant::now() + MAX_WAIT_FOR_PLACE;
        loop {
            let failed = match self.try_attach(topic) {
                Ok(port) => {
                    return Ok(Observer {
                        run: self.clone(),
                        port,
                        current: None,
                        sequence: Sequence::default(),
                        has_ended: false,
                        looked: Instant::now(),
                        held: Rc::default(),
                    });
                }
                Err(_) if self.has_ended() => {
                    return Err(not_running(self.0.manifest.out.clone()));
                }
                Err(error) => error,
            };
            if Instant::now() >= deadline || self.0.manifest.window.observers == 0 {
                return Err(failed);
            }
            thread::sleep(RETRY);
        }
    }

    pub(crate) fn try_attach<M>(&self, topic: &'static Topic) -> Result<Port<M>, RunError> {
        let places = self.0.manifest.window.observers;
        let no_place = || RunError::NoPlace {
            topic: topic.name,
            observers: places,
        };
        let service = Service::open(&self.0.node, topic)?;
        if service.subscribers_named(NAME) >= places {
            return Err(no_place());
        }
        let port = Port::of(&service, Some(NAME), &self.0.node, &self.0.manifest)?;
        // Another observer may have come at the same time. The places of the stages must stay free
        // for their restarts.
        if service.subscribers_named(NAME) > places {
            return Err(no_place());
        }
        reader::notify_publisher(&self.0.node, topic.name)?;
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

impl<M> Observer<M> {
    /// Returns the next message in the publisher's memory, and waits for it at most `limit`. The
    /// message before it is released, and the next call releases this one.
    pub fn next(&mut self, limit: Duration) -> Result<Next<'_, M>, RunError> {
        let received = self.receive(limit)?;
        Ok(match received {
            Some((message, missed)) => Next::Message(self.current.insert(message), missed),
            None if self.has_ended => Next::Ended,
            None => Next::Idle,
        })
    }

    /// Receives the next message, and the number of items that were missed directly before it.
    /// `None` after `limit`, and at the end.
    fn receive(&mut self, limit: Duration) -> Result<Option<(Received<M>, u64)>, RunError> {
        self.current = None;
        self.has_ended = false;
        let since = Instant::now();
        loop {
            while let Some(message) = self.port.receive()? {
                let item = message.item();
                let skipped = self.skipped(self.sequence.generation, item)?;
                if let Some(missed) = self.sequence.advance_past(item, skipped) {
                    return Ok(Some((message, missed)));
                }
            }
            self.has_ended = self.sequence.ended || self.run.has_ended();
            let left = limit.saturating_sub(since.elapsed());
            if self.has_ended || left.is_zero() {
                return Ok(None);
            }
            self.sleep(left.min(wake::MAX_WAIT))?;
        }
    }

    /// Receives the next message to hold, and waits for it at most `limit`; `None` after that, and
    /// at the end. An observer holds one message at a time: drop a message before the next call.
    pub fn hold(&mut self, limit: Duration) -> Result<Option<Message<M>>, RunError> {
        if Rc::strong_count(&self.held) > 1 {
            return Err(RunError::Input(format!(
                "a message of the topic `{}` is still held, and an observer holds one at a time: drop it, and copy what you keep of it",
                self.topic()
            )));
        }
        let held = Rc::clone(&self.held);
        let received = self.receive(limit)?;
        Ok(received.map(|(received, missed)| Message {
            received,
            missed,
            _held: held,
        }))
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
        let out = &self.run.manifest().out;
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

/// A message in the publisher's memory, held until it is dropped.
pub struct Message<M> {
    received: Received<M>,
    /// Items that were missed directly before it.
    pub missed: u64,
    _held: Rc<()>,
}

impl<M> Message<M> {
    pub fn received(&self) -> &Received<M> {
        &self.received
    }
}

impl<M: contract::Message> Deref for Message<M> {
    type Target = M::Header;

    fn deref(&self) -> &M::Header {
        self.received.header()
    }
}

/// The messages of a topic until the end of the run. Each is dropped before the next one.
pub struct Messages<M>(Observer<M>);

impl<M> IntoIterator for Observer<M> {
    type Item = Result<Message<M>, RunError>;
    type IntoIter = Messages<M>;

    fn into_iter(self) -> Messages<M> {
        Messages(self)
    }
}

impl<M> Iterator for Messages<M> {
    type Item = Result<Message<M>, RunError>;

    fn next(&mut self) -> Option<Self::Item> {
        self.0.hold(Duration::MAX).transpose()
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
