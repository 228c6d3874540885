//! A run of one process alone, to test whether it keeps the contract of a stage: the services of a
//! run as the supervisor creates them, publishers for the inputs of the stage, and readers of its
//! output.
//!
//! Messages are values here ([`Recorded`]), since the tester is to send also what no stage may
//! send. Readers check received messages as the readers of a run do.

mod recorded;

use std::{collections::BTreeSet, fs, os::fd::BorrowedFd, time::Duration};

use gyre_messages::{StageId, Topic};
use gyre_stage::{
    Launch, Manifest, StageError,
    message::AnyMessage,
    reader::Port,
    run::RunRoot,
    services::Services,
    transport::{self, Listener, Node, Service, Transport},
    wake::Signals,
    writer::TopicWriter,
};

use crate::{
    Death, Scheduling, StagePlan, SuperviseError,
    child::Child,
    clean,
    guardian::Guardian,
    start::{Position, Starter},
};

pub use recorded::Recorded;

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
pub struct Feed {
    writer: TopicWriter,
    topic: Service,
}

pub struct Tap(Port<AnyMessage>);

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
        let root = RunRoot::acquire(&manifest.out, signals)?;
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
        let starter = Starter {
            manifest: &self.manifest,
            signals: self.signals,
            guardian: &self.guardian,
        };
        Ok(Process {
            child: Child::spawn(&plan, &starter, Position::Free)?,
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
        let folder = self.manifest.root.join(self.transport.services_folder());
        let names = fs::read_dir(folder).into_iter().flatten().flatten();
        names
            .map(|file| file.file_name().to_string_lossy().into_owned())
            .collect()
    }

    pub fn feed(&self, topic: &str) -> Result<Feed, StageError> {
        Feed::on(&self.node, &self.manifest, topic)
    }

    pub fn tap(&self, topic: &str) -> Result<Tap, StageError> {
        Port::to(known(topic)?, &self.node, &self.manifest).map(Tap)
    }

    /// True on a request to stop.
    pub fn sleep_until_readable(
        &self,
        feeds: &[&Feed],
        connection: BorrowedFd<'_>,
        limit: Duration,
    ) -> Result<bool, StageError> {
        let handshakes: Vec<_> = feeds.iter().map(|feed| feed.writer.listener()).collect();
        let woken = self
            .signals
            .wait_or_readable(&[], &handshakes, Some(connection), limit)?;
        Ok(woken.stop)
    }

    /// True on a request to stop.
    pub fn sleep(&self, taps: &[&Tap], limit: Duration) -> Result<bool, StageError> {
        let listeners: Vec<_> = taps.iter().map(|tap| tap.listener()).collect();
        Ok(self.signals.wait(&listeners, None, limit)?.stop)
    }
}

fn known(topic: &str) -> Result<&'static Topic, StageError> {
    let found = gyre_messages::topic(topic);
    found.ok_or_else(|| StageError::Input(format!("no stage has a topic `{topic}`")))
}

impl Process {
    /// Returns the process id, which is also its group's.
    pub fn pid(&self) -> u32 {
        self.child.pid()
    }

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

    pub fn kill(mut self) -> Result<(), SuperviseError> {
        self.child.kill();
        self.child.await_end()
    }
}

impl Feed {
    /// Publishes a topic of the run that a process has joined.
    pub fn of(launch: &Launch, topic: &str) -> Result<Self, StageError> {
        Self::on(&launch.node, &launch.manifest, topic)
    }

    fn on(node: &Node, manifest: &Manifest, topic: &str) -> Result<Self, StageError> {
        let topic = known(topic)?;
        Ok(Self {
            writer: TopicWriter::to(topic, node, manifest)?,
            topic: Service::open(node, topic)?,
        })
    }

    /// Sends a message as it is, with its time stamps, and notifies its readers.
    pub fn send(&self, message: &Recorded) -> Result<(), StageError> {
        let (header, payload) = (message.header_bytes(), &message.payload);
        self.writer.send_unchanged(header, payload)
    }

    /// Sends the history to readers that have notified since the last call; returns whether there
    /// were any. A reader that does not notify is not connected to.
    pub fn answer_handshakes(&self) -> Result<bool, StageError> {
        self.writer.answer_handshakes()
    }

    /// Sends the history to all new readers, whether they have notified or not.
    pub fn connect(&self) -> Result<(), StageError> {
        self.writer.accept_readers()
    }

    pub fn subscribers(&self) -> usize {
        self.topic.subscribers()
    }
}

impl Tap {
    /// Subscribes to a topic of the run that a process has joined; `silently`, it does not ask for
    /// its history.
    pub fn of(launch: &Launch, topic: &str, silently: bool) -> Result<Self, StageError> {
        let (topic, node, manifest) = (known(topic)?, &launch.node, &launch.manifest);
        let port = match silently {
            true => Port::silent(topic, node, manifest)?,
            false => Port::to(topic, node, manifest)?,
        };
        Ok(Self(port))
    }

    pub fn receive(&self) -> Result<Option<Recorded>, StageError> {
        Ok(self.0.receive()?.map(|received| Recorded {
            header: received.header_bytes().to_vec(),
            payload: received.values::<u8>().to_vec(),
            received_ns: received.received_ns,
        }))
    }

    pub fn listener(&self) -> &Listener {
        self.0.listener()
    }
}
