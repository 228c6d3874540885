//! How a process of a run starts and ends.

use std::{
    fs::{self, OpenOptions},
    path::PathBuf,
    process::ExitCode,
    sync::Mutex,
};

use rustix::process::{Signal, set_parent_process_death_signal};
use serde::de::DeserializeOwned;
use tracing::span::EnteredSpan;

use crate::{
    Manifest, StageCounters, StageError, counters, run,
    services::{self, Node},
    wake::Signals,
};

/// What a stage has to work with: its run, its configuration, its place in the transport.
pub struct Launch {
    /// Which stage this is.
    pub name: String,
    /// The run.
    pub manifest: Manifest,
    /// SIGTERM and SIGINT, as something to wait for.
    pub signals: Signals,
    configuration: toml::Table,
    pub(crate) node: Node,
    _log: EnteredSpan,
}

impl Launch {
    /// Joins the run that [`run::ENVIRONMENT`] names.
    pub fn from_environment(name: &str) -> Result<Self, StageError> {
        let root = std::env::var_os(run::ENVIRONMENT).ok_or_else(|| StageError::NoRun {
            stage: name.to_owned(),
        })?;
        // Where a shell stands between us and the supervisor, this takes us down with the shell.
        let _ = set_parent_process_death_signal(Some(Signal::KILL));
        let manifest = Manifest::read(&PathBuf::from(root))?;
        let log = start_log(&manifest, name)?;
        let path = manifest.root.join("config.toml");
        let text = fs::read_to_string(&path).map_err(|source| StageError::File {
            path: path.clone(),
            source,
        })?;
        let configuration =
            text.parse()
                .map_err(|error: toml::de::Error| StageError::Manifest {
                    path,
                    reason: error.message().to_owned(),
                })?;
        let signals = Signals::install()?;
        let node = services::node(&manifest.transport()?, name)?;
        Ok(Self {
            name: name.to_owned(),
            manifest,
            signals,
            configuration,
            node,
            _log: log,
        })
    }

    /// A section of the run's configuration; its defaults where the section is missing.
    pub fn section<T: DeserializeOwned>(&self, section: &str) -> Result<T, StageError> {
        let table = self
            .configuration
            .get(section)
            .cloned()
            .unwrap_or_else(|| toml::Table::new().into());
        table.try_into().map_err(|error: toml::de::Error| {
            StageError::Configuration(format!(
                "[{section}] in the configuration: {}",
                error.message()
            ))
        })
    }

    /// Whether the run's configuration has a section.
    pub fn has_section(&self, section: &str) -> bool {
        self.configuration.contains_key(section)
    }

    fn leave_statistics(&self, counters: &StageCounters) -> Result<(), StageError> {
        let path = self.manifest.root.join(counters::file_name(&self.name));
        let text = serde_json::to_string(counters)
            .map_err(|e| StageError::Configuration(e.to_string()))?;
        fs::write(&path, text).map_err(|source| StageError::File { path, source })
    }
}

/// The `main` of every stage: joins the run, works until the end, says in one sentence what went wrong.
pub fn main(
    name: &str,
    work: impl FnOnce(&Launch) -> Result<StageCounters, StageError>,
) -> ExitCode {
    let result = Launch::from_environment(name).and_then(|launch| {
        tracing::debug!(pid = std::process::id(), "started");
        let counters = work(&launch)?;
        launch.leave_statistics(&counters)
    });
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            tracing::error!("{error}");
            eprintln!("{name}: {error}");
            ExitCode::from(error.exit_code())
        }
    }
}

/// All processes append to one `log.jsonl`, a line an event. Each line names its process while what is returned lives.
fn start_log(manifest: &Manifest, name: &str) -> Result<EnteredSpan, StageError> {
    let path = manifest.out.join("log.jsonl");
    let file = OpenOptions::new()
        .append(true)
        .create(true)
        .open(&path)
        .map_err(|source| StageError::File { path, source })?;
    let filter =
        tracing_subscriber::EnvFilter::try_from_env("GYRE_LOG").unwrap_or_else(|_| "info".into());
    let log = tracing_subscriber::fmt()
        .json()
        .with_env_filter(filter)
        .with_writer(Mutex::new(file));
    // A second log in one process (tests) keeps the first.
    let _ = log.try_init();
    Ok(tracing::error_span!("process", stage = name).entered())
}
