//! Start and end of a process of a run.

use std::{
    cell::Cell, collections::BTreeMap, fs, io::Write, os::fd::AsFd, path::PathBuf,
    process::ExitCode, time::Duration,
};

use gyre_contract::{
    FollowerId, Message,
    run::{RunConfig, StageConfig, StageCounters},
};
use gyre_geometry::samples::{SensorConfigs, Witness};
use gyre_transport::{
    Manifest, RunError,
    heartbeat::HeartbeatWriter,
    log::start_log,
    reader::{Port, Reader},
    run,
    transport::Node,
    wake::{self, Signals},
};
use rustix::{
    io::{Errno, ioctl_fionbio},
    mm::{MlockAllFlags, mlockall},
    process::{Signal, set_parent_process_death_signal},
};
use serde::de::DeserializeOwned;
use tracing::span::EnteredSpan;

use crate::counters;

/// The environment of a stage: its run, its configuration, and its node in the transport.
pub struct Launch {
    pub name: String,
    pub manifest: Manifest,
    pub signals: Signals,
    configuration: toml::Table,
    pub node: Node,
    has_place: Cell<bool>,
    _log: EnteredSpan,
}

impl Launch {
    pub fn from_environment(name: &str) -> Result<Self, RunError> {
        let root = std::env::var_os(run::ENVIRONMENT).ok_or_else(|| {
            RunError::Input(
                "this is one process of a run, and GYRE_RUN is not set: start the run with `gyre run CONFIG`"
                    .to_owned(),
            )
        })?;
        // If a shell is between this process and the supervisor, the process ends with the shell.
        let _ = set_parent_process_death_signal(Some(Signal::KILL));
        let manifest = Manifest::read(&PathBuf::from(root))?;
        let log = start_log(&manifest, name)?;
        let path = manifest.root.join("config.toml");
        let text = fs::read_to_string(&path).map_err(RunError::file(&path))?;
        let configuration = text
            .parse()
            .map_err(|error: toml::de::Error| RunError::manifest(&path, error.message()))?;
        let signals = Signals::install()?;
        let node = manifest.transport()?.join(name)?;
        Ok(Self {
            name: name.to_owned(),
            manifest,
            signals,
            configuration,
            node,
            has_place: Cell::new(false),
            _log: log,
        })
    }

    /// Takes this process's place in the run, after loading its data, and before opening its topics
    /// or output files. A process that stands by waits here until the one before it has ended (see
    /// [`run::STANDBY`]). [`RunError::Stopped`] on a request to stop.
    ///
    /// The loops of this crate call it. A stage with files of its own calls it before it opens
    /// them; once is enough.
    pub fn take_place(&self) -> Result<(), RunError> {
        if self.has_place.get() {
            return Ok(());
        }
        self.lock_memory()?;
        if stands_by() {
            self.stand_by()?;
        }
        self.has_place.set(true);
        // A follower may still have long logs to read: its loop begins the heartbeat.
        if FollowerId::by_name(&self.name).is_none() {
            self.begin_heartbeat()?;
        }
        Ok(())
    }

    pub(crate) fn begin_heartbeat(&self) -> Result<(), RunError> {
        let heartbeat = HeartbeatWriter::create(&self.manifest, &self.name)?;
        self.signals.report_to(heartbeat);
        Ok(())
    }

    fn stand_by(&self) -> Result<(), RunError> {
        let failed = |error: Errno| RunError::transport("read standard input", error);
        let input = std::io::stdin();
        ioctl_fionbio(&input, true).map_err(failed)?;
        run::write(run::ready_file(&self.manifest.root, &self.name), "")?;
        loop {
            match rustix::io::read(&input, &mut [0_u8; 64]) {
                Ok(0) => return Ok(()),
                Ok(_) | Err(Errno::AGAIN | Errno::INTR) => {}
                Err(error) => return Err(failed(error)),
            }
            let input = Some(input.as_fd());
            let signals = &self.signals;
            let woken = signals.wait_or_readable(&[], &[], input, wake::MAX_WAIT)?;
            if woken.stop {
                return Err(RunError::Stopped);
            }
        }
    }

    /// Keeps all memory of this process from being paged out, if the configuration asks for it.
    fn lock_memory(&self) -> Result<(), RunError> {
        let is_follower = FollowerId::by_name(&self.name).is_some();
        let run: RunConfig = self.section("run")?;
        // Followers have their own settings alone.
        let of_run = run.scheduling.lock_memory && !is_follower;
        if !of_run && !self.own_section()?.scheduling.lock_memory {
            return Ok(());
        }
        mlockall(MlockAllFlags::CURRENT | MlockAllFlags::FUTURE).map_err(|error| {
            RunError::Input(format!(
                "scheduling.lock_memory is set, but the memory cannot be locked: {error}; raise `ulimit -l`, or LimitMEMLOCK of the unit"
            ))
        })
    }

    /// Subscribes to a topic. `next` is the first item that is wanted; with `None` the first item
    /// that arrives.
    pub fn reader<M: Message>(&self, next: Option<u64>) -> Result<Reader<M>, RunError> {
        Reader::open(&self.node, &self.manifest, next)
    }

    pub fn port<M: Message>(&self) -> Result<Port<M>, RunError> {
        Port::open(&self.node, &self.manifest)
    }

    fn own_section(&self) -> Result<StageConfig, RunError> {
        let mut stages: BTreeMap<String, StageConfig> = self.section("stages")?;
        Ok(stages.remove(&self.name).unwrap_or_default())
    }

    /// Returns the delay that the configuration adds to the work on each item, to test behaviour
    /// under load.
    pub(crate) fn delay(&self) -> Result<Duration, RunError> {
        Ok(Duration::from_millis(self.own_section()?.delay_ms))
    }

    /// Returns a section of the run's configuration, or its defaults if the section is missing.
    pub fn section<T: DeserializeOwned>(&self, section: &str) -> Result<T, RunError> {
        let table = self.configuration.get(section).cloned();
        let table = table.unwrap_or_else(|| toml::Table::new().into());
        read(section, table)
    }

    /// Returns the sections of the sensors beside the radar.
    pub fn sensors(&self) -> Result<SensorConfigs, RunError> {
        read(
            &Witness::ALL.map(Witness::name).join("] or ["),
            self.configuration.clone().into(),
        )
    }

    pub fn has_section(&self, section: &str) -> bool {
        self.configuration.contains_key(section)
    }
}

fn read<T: DeserializeOwned>(section: &str, table: toml::Value) -> Result<T, RunError> {
    table.try_into().map_err(|error: toml::de::Error| {
        RunError::Input(format!(
            "[{section}] in the configuration: {}",
            error.message()
        ))
    })
}

fn stands_by() -> bool {
    std::env::var_os(run::STANDBY).is_some()
}

/// Runs a stage as the `main` of its process: joins the run, works until its end, and prints an
/// error as one sentence.
pub fn main(name: &str, work: impl FnOnce(&Launch) -> Result<StageCounters, RunError>) -> ExitCode {
    let result = Launch::from_environment(name).and_then(|launch| {
        tracing::debug!(pid = std::process::id(), "started");
        let counters = match work(&launch) {
            Err(RunError::Stopped) => StageCounters::default(),
            worked => worked?,
        };
        counters::write(&counters, &launch.manifest, name)
    });
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            // The span of the launch has ended.
            let stage = tracing::error_span!("process", stage = name);
            stage.in_scope(|| tracing::error!("{error}"));
            // The supervisor reads the last line.
            let sentence = format!("{name}: {error}").replace('\n', " ");
            let _ = writeln!(std::io::stderr(), "{sentence}");
            ExitCode::from(error.exit_code())
        }
    }
}
