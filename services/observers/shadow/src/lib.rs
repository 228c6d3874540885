//! Shadow mode: a second program for a stage of a running run. It gets the same inputs as the stage, its results are compared with the
//! stage's and timed, and nobody uses them.
//!
//! To the run this process is an observer ([`gyre_stage::observer`]): the run neither waits for it nor fails with it. The program runs in a
//! run of its own, alone, where this process sends it what it has observed, an item at a time. What it does there, the observed run does
//! not notice, but for the processor time.
//!
//! Reading order: [`shadow`], `shadowing` (the loop), `observation` (the items of the run), `stream` (how an item is sent to the shadow),
//! `life` (the process), `record`, [`Report`].

mod inlet;
mod life;
mod observation;
mod record;
mod report;
mod shadowing;
mod stream;

use std::{
    fs, io,
    path::{Path, PathBuf},
    time::Duration,
};

use gyre_conformance::topology::Ports;
use gyre_messages::StageId;
use gyre_stage::{StageError, observer::ObservedRun, wake::Signals};
use gyre_supervise::{Scheduling, SuperviseError};
use thiserror::Error;

pub use record::Counts;
pub use report::{Beside, Report, Spread, Spreads, Verdict};

use life::Subject;
use record::Record;
use shadowing::Shadowing;

/// The stages that can have a shadow: those between source and sink.
pub const STAGES: [StageId; 5] = [
    StageId::Masking,
    StageId::RotationSearch,
    StageId::TranslationSearch,
    StageId::JointSearch,
    StageId::Refinement,
];

/// What runs as the shadow of which stage, and for how long.
#[derive(Clone, Debug)]
pub struct Options {
    /// The stage.
    pub stage: StageId,
    /// The program and its arguments.
    pub command: Vec<String>,
    /// The program of the guardian, which ends the shadow if this process is killed.
    pub gyre: String,
    /// The priority of the shadow.
    pub scheduling: Scheduling,
    /// Time for it to open its topics.
    pub start_timeout: Duration,
    /// Time for an item.
    pub patience: Duration,
    /// Items to compare; `None`: until the run ends.
    pub scans: Option<u64>,
    /// Time after which it ends.
    pub duration: Option<Duration>,
    /// A folder for `shadow.json`, `shadow.csv` and what the program prints, `shadow.txt`.
    pub report: Option<PathBuf>,
}

/// Why there is no comparison.
#[derive(Debug, Error)]
pub enum ShadowError {
    /// The run cannot be observed, or the transport fails.
    #[error(transparent)]
    Stage(#[from] StageError),
    /// The program cannot be started.
    #[error(transparent)]
    Supervise(#[from] SuperviseError),
    /// A file or a folder.
    #[error("{path}: {source}")]
    File {
        /// The path.
        path: PathBuf,
        /// The system error.
        source: io::Error,
    },
    /// The rows of `shadow.csv` cannot be written.
    #[error("cannot write shadow.csv: {0}")]
    Rows(csv::Error),
    /// The report cannot be written.
    #[error("cannot write shadow.json: {0}")]
    Report(#[from] serde_json::Error),
}

impl ShadowError {
    fn file(path: &Path) -> impl FnOnce(io::Error) -> Self + use<> {
        let path = path.to_owned();
        move |source| Self::File { path, source }
    }
}

/// Runs a program as the shadow of a stage until the run ends, the options say so, or a signal requests a stop. `observe` receives how it
/// goes.
///
/// # Errors
/// The run cannot be observed, the program cannot be started, or the report cannot be written. What the program does wrong is no error: the
/// report says so.
pub fn shadow(
    run: &ObservedRun,
    options: &Options,
    observe: &mut dyn FnMut(&str),
) -> Result<Report, ShadowError> {
    let signals = Signals::install()?;
    let stage = options.stage;
    let ports = Ports::of(stage, run.manifest());
    let in_report = |name| options.report.as_ref().map(|folder| folder.join(name));
    if let Some(folder) = &options.report {
        fs::create_dir_all(folder).map_err(ShadowError::file(folder))?;
    }
    let folder = tempfile::Builder::new().prefix("gyre-shadow-").tempdir();
    let folder = folder.map_err(ShadowError::file(&std::env::temp_dir()))?;
    let configuration = run.manifest().root.join("config.toml");
    let subject = Subject {
        stage,
        command: options.command.clone(),
        gyre: options.gyre.clone(),
        scheduling: options.scheduling.clone(),
        manifest: run.manifest().clone(),
        configuration: fs::read_to_string(&configuration)
            .map_err(ShadowError::file(&configuration))?,
        folder: folder.path().to_owned(),
        output: in_report("shadow.txt"),
    };
    if let Some(path) = &subject.output {
        fs::write(path, "").map_err(ShadowError::file(path))?;
    }
    let record = Record::new(stage, ports.output, in_report("shadow.csv").as_deref())?;
    let shadowing = Shadowing::begin(options, &subject, run, &signals, &ports, record)?;
    let record = shadowing.run(observe)?;
    let report = Report::of(stage.name(), &options.command, &record);
    if let Some(path) = in_report("shadow.json") {
        let text = serde_json::to_string_pretty(&report)?;
        fs::write(&path, text).map_err(ShadowError::file(&path))?;
    }
    Ok(report)
}
