//! A run of one process alone, to test whether it keeps the contract of a stage: the services of a
//! run as the supervisor creates them, publishers for the inputs of the stage, and readers of its
//! output.
//!
//! Messages are values here ([`Recorded`]), since the tester is to send also what no stage may
//! send. Readers check received messages as the readers of a run do.

mod recorded;

use std::{collections::BTreeSet, fs, os::fd::BorrowedFd, path::PathBuf, time::Duration};

use gyre_messages::{
    Correction, Fix, Loop, Masked, Message, Motion, Objects, Pose, Refined, Rotation, Scan,
    StageId, Topic,
};
use gyre_stage::{
    Launch, Manifest, StageError,
    reader::Port,
    run::{self, RunRoot},
    services::Services,
    transport::{self, Listener, Node, Service, Transport},
    wake::Signals,
    writer::Writer,
};

use crate::{
    Death, Scheduling, StagePlan, SuperviseError,
    child::Child,
    clean,
    guardian::Guardian,
    start::{Position, Starter},
};

pub use recorded::Recorded;

/// A run without processes, to start one in it.
pub struct Rig<'a> {
    manifest: Manifest,
    services: Option<Services>,
    node: Node,
    guardian: Guardian,
    transport: Transport,
    signals: &'a Signals,
    // Last: removes all files of the run.
    _root: RunRoot,
}

/// A process as the supervisor starts it. It is killed when this value is dropped.
pub struct Process {
    child: Child,
    death: Option<Death>,
}

/// The publisher of a topic, in place of the stage that it is of.
pub trait Feed {
    /// Sends a message as it is, with its time stamps and its process id, and notifies its readers.
    fn send(&self, message: &Recorded) -> Result<(), StageError>;

    /// Sends the history to readers that have notified since the last call; returns whether there
    /// were any. A reader that does not notify is not connected to.
    fn answer_handshakes(&self) -> Result<bool, StageError>;

    /// Sends the history to all new readers, whether they have notified or not.
    fn connect(&self) -> Result<(), StageError>;

    /// Returns the number of subscribers of the topic.
    fn subscribers(&self) -> usize;

    /// Returns the listener that new readers notify.
    fn listener(&self) -> &Listener;
}

/// A reader of a topic.
pub trait Tap {
    /// Receives the next message; `None` if the queue is empty.
    fn receive(&self) -> Result<Option<Recorded>, StageError>;

    /// Returns the listener that the publisher notifies.
    fn listener(&self) -> &Listener;
}

impl<'a> Rig<'a> {
    /// Creates the root of a run with this manifest, whose prefix and root are set, and this
    /// configuration, and the services of the run. `guardian` is as in [`Plan`](crate::Plan).
    pub fn new(
        manifest: Manifest,
        configuration: &str,
        guardian: &[String],
        signals: &'a Signals,
    ) -> Result<Self, SuperviseError> {
        let mut rig = Self::without_services(manifest, configuration, guardian, signals)?;
        rig.services = Some(Services::create(&rig.node, &rig.manifest.window)?);
        Ok(rig)
    }

    pub fn without_services(
        mut manifest: Manifest,
        configuration: &str,
        guardian: &[String],
        signals: &'a Signals,
    ) -> Result<Self, SuperviseError> {
        transport::silence();
        let unusable = |e: run::RootError| StageError::Input(e.to_string());
        let root = RunRoot::acquire(&manifest.out, signals).map_err(unusable)?;
        (manifest.prefix, manifest.root) = (root.prefix(), root.path().to_owned());
        manifest.write(configuration)?;
        let transport = manifest.transport()?;
        Ok(Self {
            services: None,
            node: transport.join("supervisor")?,
            guardian: Guardian::start(guardian, &manifest.root, [])?,
            manifest,
            transport,
            signals,
            _root: root,
        })
    }

    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// The output is appended to the log of the process.
    pub fn start(
        &self,
        name: &str,
        command: &[String],
        scheduling: &Scheduling,
    ) -> Result<Process, SuperviseError> {
        let plan = StagePlan {
            scheduling: scheduling.clone(),
            ..StagePlan::new(name, command.to_vec())
        };
        let starter = Starter::new(self.signals, &self.guardian);
        Ok(Process {
            child: Child::spawn(&plan, &self.manifest, &starter, Position::Free)?,
            death: None,
        })
    }

    /// Removes the remains of a killed process, as the supervisor does before it starts a new one.
    pub fn remove_dead(&self) -> Result<(), SuperviseError> {
        clean::remove_dead(&self.manifest, &self.transport, false)
    }

    pub fn has_publisher(&self, stage: StageId) -> bool {
        let services = self.services.as_ref();
        services.is_some_and(|services| services.has_publisher(stage))
    }

    /// Returns the names of the files that describe the services which exist.
    pub fn services(&self) -> BTreeSet<String> {
        let folder = fs::read_dir(self.services_folder());
        let names = folder.into_iter().flatten().flatten();
        names
            .map(|file| file.file_name().to_string_lossy().into_owned())
            .collect()
    }

    fn services_folder(&self) -> PathBuf {
        self.manifest.root.join(self.transport.services_folder())
    }

    pub fn feed(&self, topic: &str) -> Result<Box<dyn Feed>, StageError> {
        self.ports().feed(topic)
    }

    /// Subscribes to a topic of a stage, and asks for its history.
    pub fn tap(&self, topic: &str) -> Result<Box<dyn Tap>, StageError> {
        self.ports().tap(topic, Joining::Asks)
    }

    fn ports(&self) -> Ports<'_> {
        Ports {
            node: &self.node,
            manifest: &self.manifest,
        }
    }

    /// True on a request to stop.
    pub fn sleep_until_readable(
        &self,
        feeds: &[&dyn Feed],
        connection: BorrowedFd<'_>,
        limit: Duration,
    ) -> Result<bool, StageError> {
        let handshakes: Vec<_> = feeds.iter().map(|feed| feed.listener()).collect();
        let woken = self
            .signals
            .wait_or_readable(&[], &handshakes, Some(connection), limit)?;
        Ok(woken.stop)
    }

    /// True on a request to stop.
    pub fn sleep(&self, taps: &[&dyn Tap], limit: Duration) -> Result<bool, StageError> {
        let listeners: Vec<_> = taps.iter().map(|tap| tap.listener()).collect();
        self.signals.sleep_until_any(&listeners, limit)
    }
}

/// The manner of a reader's joining.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Joining {
    /// It notifies the publisher, and so receives its history.
    Asks,
    Silently,
}

/// The topics of a run by their names, for processes that do more or less than a stage may.
pub struct Ports<'a> {
    node: &'a Node,
    manifest: &'a Manifest,
}

/// Calls a method for the message type of a topic.
macro_rules! of_topic {
    ($topic:expr, $self:ident.$method:ident($($argument:expr),*)) => {
        match $topic {
            Scan::TOPIC => $self.$method::<Scan>($($argument),*),
            Masked::TOPIC => $self.$method::<Masked>($($argument),*),
            Rotation::TOPIC => $self.$method::<Rotation>($($argument),*),
            Motion::TOPIC => $self.$method::<Motion>($($argument),*),
            Refined::TOPIC => $self.$method::<Refined>($($argument),*),
            Pose::TOPIC => $self.$method::<Pose>($($argument),*),
            Loop::TOPIC => $self.$method::<Loop>($($argument),*),
            Correction::TOPIC => $self.$method::<Correction>($($argument),*),
            Fix::TOPIC => $self.$method::<Fix>($($argument),*),
            Objects::TOPIC => $self.$method::<Objects>($($argument),*),
            topic => Err(no_such(topic)),
        }
    };
}

impl<'a> Ports<'a> {
    /// The topics of the run that a process has joined.
    pub fn of(launch: &'a Launch) -> Self {
        Self {
            node: launch.node(),
            manifest: &launch.manifest,
        }
    }

    pub fn feed(&self, topic: &str) -> Result<Box<dyn Feed>, StageError> {
        of_topic!(topic, self.open_feed())
    }

    pub fn tap(&self, topic: &str, joining: Joining) -> Result<Box<dyn Tap>, StageError> {
        of_topic!(topic, self.open_tap(joining))
    }

    fn open_feed<M: Message<Header: Copy>>(&self) -> Result<Box<dyn Feed>, StageError> {
        Ok(Box::new(TypedFeed::<M> {
            writer: Writer::open(self.node, self.manifest)?,
            topic: Service::open(self.node, &Topic::of::<M>())?,
        }))
    }

    fn open_tap<M: Message<Header: Copy>>(
        &self,
        joining: Joining,
    ) -> Result<Box<dyn Tap>, StageError> {
        let port = match joining {
            Joining::Asks => Port::<M>::on(self.node, self.manifest)?,
            Joining::Silently => Port::<M>::silent(self.node, self.manifest)?,
        };
        Ok(Box::new(port))
    }
}

fn no_such(topic: &str) -> StageError {
    StageError::Input(format!("no stage has a topic `{topic}`"))
}

impl Process {
    /// Returns the process id, which is also its group's.
    pub fn pid(&self) -> u32 {
        self.child.pid()
    }

    /// Returns how it ended; `None` while it runs.
    pub fn death(&mut self) -> Option<Death> {
        if self.death.is_none() && self.child.has_exited() {
            // Once: it takes the last words.
            self.death = Some(self.child.death());
        }
        self.death.clone()
    }

    /// Sends SIGTERM to the group.
    pub fn terminate(&self) {
        self.child.terminate();
    }

    /// Kills the group and waits for its end.
    pub fn kill(mut self) -> Result<(), SuperviseError> {
        self.child.kill();
        self.child.await_end()
    }
}

struct TypedFeed<M: Message> {
    writer: Writer<M>,
    topic: Service,
}

impl<M: Message<Header: Copy>> Feed for TypedFeed<M> {
    fn send(&self, message: &Recorded) -> Result<(), StageError> {
        let mut draft = self.writer.loan()?;
        let (header, bytes) = draft.parts::<u8>();
        *header = message.header::<M>()?;
        let length = message.payload.len().min(bytes.len());
        bytes[..length].copy_from_slice(&message.payload[..length]);
        self.writer.send_unchanged(draft)
    }

    fn answer_handshakes(&self) -> Result<bool, StageError> {
        self.writer.answer_handshakes()
    }

    fn connect(&self) -> Result<(), StageError> {
        self.writer.accept_readers()
    }

    fn subscribers(&self) -> usize {
        self.topic.subscribers()
    }

    fn listener(&self) -> &Listener {
        self.writer.listener()
    }
}

impl<M: Message<Header: Copy>> Tap for Port<M> {
    fn receive(&self) -> Result<Option<Recorded>, StageError> {
        let received = Self::receive(self)?;
        Ok(received.map(|received| {
            Recorded::of::<M>(
                received.header(),
                received.values::<u8>(),
                received.received_ns,
            )
        }))
    }

    fn listener(&self) -> &Listener {
        Self::listener(self)
    }
}
