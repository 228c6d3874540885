//! A run of one process alone, to test whether it keeps the contract of a stage: the services of a
//! run as the supervisor creates them, publishers for the inputs of the stage, and readers of its
//! output.
//!
//! Messages are values here ([`Recorded`]), since the tester is to send also what no stage may
//! send. Readers check received messages as the readers of a run do.

mod recorded;

use std::{collections::BTreeSet, fs, time::Duration};

use gyre_contract::{StageId, Topic};
use gyre_transport::{
    AnyMessage, Manifest, RunError,
    reader::Port,
    run::RunRoot,
    services::Services,
    transport::{self, Node, Transport},
    wake::Signals,
    writer::TopicWriter,
};

use crate::{
    Death, Scheduling, StagePlan, SuperviseError, child::Child, clean, guardian::Guardian,
    start::Starter,
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

/// A reader of a topic.
pub type Tap = Port<AnyMessage>;

impl<'a> Rig<'a> {
    /// Creates the root of a run with this manifest, whose prefix and root are set, and this
    /// configuration. `guardian` is as in [`Plan`](crate::Plan). The run has no services yet.
    pub fn new(
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

    pub fn create_services(&mut self) -> Result<(), RunError> {
        self.services = Some(Services::create(&self.node, &self.manifest.window)?);
        Ok(())
    }

    pub fn manifest(&self) -> &Manifest {
        &self.manifest
    }

    /// The output is appended to the log of the process. One that stands by waits for
    /// [`Process::end_input`].
    pub fn start(
        &self,
        name: &str,
        command: &[String],
        scheduling: &Scheduling,
        stands_by: bool,
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
            child: Child::spawn(&plan, &starter, stands_by)?,
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

    /// Returns a publisher of a topic, in place of the stage that it is of.
    pub fn feed(&self, topic: &str) -> Result<TopicWriter, RunError> {
        TopicWriter::to(known(topic)?, &self.node, &self.manifest)
    }

    pub fn tap(&self, topic: &str) -> Result<Tap, RunError> {
        Tap::to(known(topic)?, &self.node, &self.manifest)
    }

    pub fn subscribers(&self, topic: &str) -> usize {
        let services = self.services.as_ref();
        services.map_or(0, |services| services.subscribers(topic))
    }

    /// Sleeps until a message may be there or `limit` has passed; [`RunError::Stopped`] on a
    /// request to stop.
    pub fn sleep(&self, taps: &[&Tap], limit: Duration) -> Result<(), RunError> {
        let listeners: Vec<_> = taps.iter().map(|tap| tap.listener()).collect();
        match self.signals.wait(&listeners, None, limit)?.stop {
            true => Err(RunError::Stopped),
            false => Ok(()),
        }
    }
}

fn known(topic: &str) -> Result<&'static Topic, RunError> {
    let found = gyre_contract::topic(topic);
    found.ok_or_else(|| RunError::Input(format!("no stage has a topic `{topic}`")))
}

impl Process {
    pub fn death(&mut self) -> Option<Death> {
        if self.death.is_none() && self.child.has_exited() {
            // Once: it takes the last words.
            self.death = Some(self.child.death());
        }
        self.death.clone()
    }

    pub fn end_input(&mut self) {
        self.child.end_input();
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
