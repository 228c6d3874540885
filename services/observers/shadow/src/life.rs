//! One life of the shadow: its process, alone in a run of its own, and this program in place of the rest of that run.

use std::{
    collections::BTreeMap,
    fs,
    io::Write,
    path::{Path, PathBuf},
    time::{Duration, Instant},
};

use gyre_conformance::topology::Ports;
use gyre_messages::{StageId, Window};
use gyre_refinement::checkpoint;
use gyre_stage::{Listener, Manifest, StageError, wake::Signals};
use gyre_supervise::{
    Death, Scheduling,
    rig::{Feed, Process, Recorded, Rig, Tap},
};

use crate::ShadowError;

/// Messages that are taken at once of a program that may send without end.
const AT_ONCE: usize = 64;
/// Time between two looks at the size of its log.
const LOG_PERIOD: Duration = Duration::from_secs(1);
/// Time to exit after SIGTERM, as in a run.
const STOP_TIMEOUT: Duration = Duration::from_secs(2);
/// Time between two looks at a process that is to exit.
const LOOK: Duration = Duration::from_millis(5);

/// What is started, and beside which run.
pub(crate) struct Subject {
    pub stage: StageId,
    pub command: Vec<String>,
    /// The program of the guardian.
    pub gyre: String,
    pub scheduling: Scheduling,
    /// The manifest of the observed run.
    pub manifest: Manifest,
    /// The configuration of the observed run, TOML.
    pub configuration: String,
    /// The place for the files of all lives.
    pub folder: PathBuf,
    /// The file for what the program prints.
    pub output: Option<PathBuf>,
}

/// A process in a run of its own.
pub(crate) struct Life<'a> {
    // Dropped in this order: process, ports, run.
    process: Process,
    feeds: BTreeMap<&'static str, Box<dyn Feed>>,
    tap: Box<dyn Tap>,
    rig: Rig<'a>,
    stage: StageId,
    began: Instant,
    is_open: bool,
    log_due: Instant,
}

/// What a program has sent, or that it cannot be read.
pub(crate) type Sent = Result<Recorded, String>;

impl<'a> Life<'a> {
    /// Starts the program in a run of its own.
    ///
    /// # Errors
    /// Folders or services that cannot be created, a command that cannot be started.
    pub(crate) fn begin(subject: &Subject, signals: &'a Signals) -> Result<Self, ShadowError> {
        let manifest = subject.manifest_of_its_own()?;
        let guardian = [&subject.gyre, "guard"].map(str::to_owned);
        let rig = Rig::new(manifest, &subject.configuration, &guardian, signals)?;
        let ports = Ports::of(subject.stage, rig.manifest());
        let mut feeds = BTreeMap::new();
        for (topic, _) in &ports.inputs {
            feeds.insert(*topic, rig.feed(topic)?);
        }
        let tap = rig.tap(ports.output)?;
        let (name, now) = (subject.stage.name(), Instant::now());
        Ok(Self {
            process: rig.start(name, &subject.command, &subject.scheduling)?,
            feeds,
            tap,
            rig,
            stage: subject.stage,
            began: now,
            is_open: false,
            log_due: now,
        })
    }

    /// Answers the handshakes of the process. Returns whether it has opened its topics.
    ///
    /// # Errors
    /// A failure of the transport.
    pub(crate) fn attend(&mut self) -> Result<bool, StageError> {
        for feed in self.feeds.values() {
            feed.answer_handshakes()?;
        }
        if !self.is_open && self.rig.has_publisher(self.stage) {
            self.is_open = true;
            self.feeds.values().try_for_each(|feed| feed.connect())?;
        }
        if Instant::now() >= self.log_due {
            self.log_due = Instant::now() + LOG_PERIOD;
            self.rig.bound_log(self.stage.name());
        }
        Ok(self.is_open)
    }

    pub(crate) fn is_open(&self) -> bool {
        self.is_open
    }

    /// Returns the time since its start.
    pub(crate) fn age(&self) -> Duration {
        self.began.elapsed()
    }

    /// Publishes a message on a topic of its inputs.
    ///
    /// # Errors
    /// A failure of the transport.
    pub(crate) fn feed(&self, topic: &str, message: &Recorded) -> Result<(), StageError> {
        self.feeds
            .get(topic)
            .map_or(Ok(()), |feed| feed.send(message))
    }

    /// Takes some of what it has sent.
    ///
    /// # Errors
    /// A failure of the transport.
    pub(crate) fn take(&self) -> Result<Vec<Sent>, StageError> {
        let mut all = Vec::new();
        while all.len() < AT_ONCE {
            match self.tap.receive() {
                Ok(None) => break,
                Ok(Some(message)) => all.push(Ok(message)),
                Err(StageError::Malformed { seq, reason, .. }) => all.push(Err(format!(
                    "item {seq} cannot be read by any stage: {reason}"
                ))),
                Err(error) => return Err(error),
            }
        }
        Ok(all)
    }

    /// Returns how it ended; `None` while it runs.
    pub(crate) fn death(&mut self) -> Option<Death> {
        self.process.death()
    }

    /// Returns the listener that it notifies of what it sends.
    pub(crate) fn listener(&self) -> &Listener {
        self.tap.listener()
    }

    /// Asks it to end, and kills it if it does not.
    ///
    /// # Errors
    /// The system refuses to wait.
    pub(crate) fn end(&mut self) -> Result<(), StageError> {
        self.process.terminate();
        let since = Instant::now();
        while self.process.death().is_none() && since.elapsed() < STOP_TIMEOUT {
            std::thread::sleep(LOOK);
            self.attend()?;
        }
        Ok(())
    }
}

impl Subject {
    /// Returns the manifest of a run of its own, whose folders are created: that of the observed run, but lossless. What the run's masking
    /// has dropped is not sent at all.
    fn manifest_of_its_own(&self) -> Result<Manifest, ShadowError> {
        let out = self.folder.join("out");
        if out.exists() {
            fs::remove_dir_all(&out).map_err(ShadowError::file(&out))?;
        }
        for folder in ["log", "journal"] {
            let path = out.join(folder);
            fs::create_dir_all(&path).map_err(ShadowError::file(&path))?;
        }
        if self.stage == StageId::Refinement {
            self.copy_state(&out)?;
        }
        Ok(Manifest {
            out,
            live: false,
            window: Window {
                live_depth: 0,
                observers: 0,
                ..self.manifest.window
            },
            ..self.manifest.clone()
        })
    }

    /// Appends what a life of the program has printed to the file for it.
    ///
    /// # Errors
    /// A file that cannot be read or written.
    pub(crate) fn keep_output(&self, life: &Life<'_>) -> Result<(), ShadowError> {
        let Some(path) = &self.output else {
            return Ok(());
        };
        let from = log_of(&life.rig.manifest().out, self.stage);
        let appended = fs::read(&from).and_then(|printed| {
            let file = fs::OpenOptions::new().create(true).append(true).open(path);
            file?.write_all(&printed)
        });
        appended.map_err(ShadowError::file(path))
    }

    /// Copies the state of the run's refinement, from which a restarted one or one that is swapped in goes on too.
    fn copy_state(&self, out: &Path) -> Result<(), ShadowError> {
        let (from, to) = (checkpoint::path(&self.manifest.out), checkpoint::path(out));
        match fs::copy(&from, to) {
            Ok(_) => Ok(()),
            // A replaced refinement need not have one.
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(()),
            Err(source) => Err(ShadowError::File { path: from, source }),
        }
    }
}

fn log_of(out: &Path, stage: StageId) -> PathBuf {
    out.join("log").join(format!("{}.txt", stage.name()))
}
