//! Start and end of a process of a run.

use std::{
    fs::{self, OpenOptions},
    io::Write,
    os::unix::fs::OpenOptionsExt,
    path::PathBuf,
    process::ExitCode,
    sync::Mutex,
    time::Duration,
};

use rustix::process::{Signal, set_parent_process_death_signal};
use serde::de::DeserializeOwned;
use tracing::span::EnteredSpan;

use crate::{
    Manifest, StageCounters, StageError, counters, run,
    services::{self, Node},
    wake::Signals,
};

/// The environment of a stage: its run, its configuration, and its node in the transport.
pub struct Launch {
    /// The name of the stage.
    pub name: String,
    /// The manifest of the run.
    pub manifest: Manifest,
    /// The signals that the process waits for.
    pub signals: Signals,
    configuration: toml::Table,
    pub(crate) node: Node,
    _log: EnteredSpan,
}

impl Launch {
    /// Joins the run that [`run::ENVIRONMENT`] names.
    ///
    /// # Errors
    /// No run is named, its files cannot be read, or the transport fails.
    pub fn from_environment(name: &str) -> Result<Self, StageError> {
        let root = std::env::var_os(run::ENVIRONMENT).ok_or_else(|| StageError::NoRun {
            stage: name.to_owned(),
        })?;
        // If a shell is between this process and the supervisor, the process ends with the shell.
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

    /// Returns a section of the run's configuration, or its defaults if the section is missing.
    ///
    /// # Errors
    /// A key or value that the section does not allow.
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

    /// Returns the delay that the configuration adds to the work on each item, to test behaviour under load.
    pub(crate) fn delay(&self) -> Duration {
        let stages = self.configuration.get("stages");
        let own = stages.and_then(|stages| stages.get(&self.name)?.get("delay_ms")?.as_integer());
        Duration::from_millis(own.map_or(0, |delay_ms| delay_ms.max(0) as u64))
    }

    /// Returns whether the run's configuration has a section.
    pub fn has_section(&self, section: &str) -> bool {
        self.configuration.contains_key(section)
    }

    fn write_counters(&self, counters: &StageCounters) -> Result<(), StageError> {
        let path = self.manifest.root.join(counters::file_name(&self.name));
        let text = serde_json::to_string(counters)
            .map_err(|e| StageError::Configuration(e.to_string()))?;
        run::write(path, &text)
    }
}

/// Runs a stage as the `main` of its process: joins the run, works until its end, and prints an error as one sentence.
pub fn main(
    name: &str,
    work: impl FnOnce(&Launch) -> Result<StageCounters, StageError>,
) -> ExitCode {
    let result = Launch::from_environment(name).and_then(|launch| {
        tracing::debug!(pid = std::process::id(), "started");
        let counters = work(&launch)?;
        launch.write_counters(&counters)
    });
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            tracing::error!("{error}");
            let sentence = format!("{name}: {error}");
            // Either fails if the disk is full.
            let _ = writeln!(std::io::stderr(), "{sentence}");
            leave_last_words(name, &sentence);
            ExitCode::from(error.exit_code())
        }
    }
}

/// Returns the name of the file in the run's root in which a stage says why it ended.
pub(crate) fn last_words(stage: &str) -> String {
    format!("{stage}.error")
}

/// Tells the supervisor why the stage ended, in shared memory: the disk of the logs may be full.
fn leave_last_words(stage: &str, sentence: &str) {
    if let Some(root) = std::env::var_os(run::ENVIRONMENT) {
        let _ = run::write(PathBuf::from(root).join(last_words(stage)), sentence);
    }
}

/// Starts logging to `log.jsonl`, to which all processes append one line per event. While the returned span lives, each line
/// carries the name of the stage.
fn start_log(manifest: &Manifest, name: &str) -> Result<EnteredSpan, StageError> {
    let path = manifest.events();
    let file = OpenOptions::new()
        .append(true)
        .create(true)
        .mode(0o600)
        .open(&path)
        .map_err(|source| StageError::File { path, source })?;
    let filter =
        tracing_subscriber::EnvFilter::try_from_env("GYRE_LOG").unwrap_or_else(|_| "info".into());
    let log = tracing_subscriber::fmt()
        .json()
        .with_env_filter(filter)
        // They would be printed to standard error, and panic if that cannot be written either.
        .log_internal_errors(false)
        .with_writer(Mutex::new(file));
    // A second call in one process (tests) keeps the first log.
    let _ = log.try_init();
    Ok(tracing::error_span!("process", stage = name).entered())
}
