//! Shadow mode: a second program for a stage of a running run. It gets the same inputs as the
//! stage, its results are compared with the stage's and timed, and nobody uses them.
//!
//! To the run this process is an observer ([`gyre_client::observer`]): the run neither waits for it
//! nor fails with it. The program gets the observed items one at a time. The only cost for the
//! observed run is processor time.

mod life;
mod observation;
mod record;
mod renumbering;
mod report;
mod shadowing;

use std::{fs, path::PathBuf, time::Duration};

use gyre_client::{Manifest, Run, RunError, Signals};
use gyre_configuration::terminal::Failure;
use gyre_contract::{StageId, Window};
use gyre_supervise::Scheduling;

use crate::conformance::Candidate;

pub use record::Counts;
pub use report::{Beside, Report, Verdict};

use life::ShadowProgram;
use record::Record;
use shadowing::Shadowing;

#[derive(Clone, Debug)]
pub struct Options {
    pub stage: StageId,
    pub command: Vec<String>,
    pub scheduling: Scheduling,
    /// Time for it to open its topics.
    pub start_timeout: Duration,
    pub item_timeout: Duration,
    /// Items to compare; `None`: until the run ends.
    pub scans: Option<u64>,
    /// Time after which it ends.
    pub duration: Option<Duration>,
    /// A folder for `shadow.json`, `shadow.csv`, and the output of the program, `shadow.txt`.
    pub report: Option<PathBuf>,
}

/// Runs a program as the shadow of a stage until the run ends, a limit is reached, or a signal
/// requests a stop. `observe` receives lines about the progress. Faults of the program are in the
/// report, not in the error.
pub fn shadow(
    run: &Run,
    options: &Options,
    observe: &mut dyn FnMut(&str),
) -> Result<Report, Failure> {
    let signals = Signals::install()?;
    let in_report = |name| options.report.as_ref().map(|folder| folder.join(name));
    if let Some(folder) = &options.report {
        gyre_storage::create_folder(folder).map_err(RunError::from)?;
    }
    let folder = tempfile::Builder::new().prefix("gyre-shadow-").tempdir();
    let folder = folder.map_err(RunError::file(&std::env::temp_dir()))?;
    let program = ShadowProgram {
        candidate: candidate(run, options)?,
        folder: folder.path().to_owned(),
        output: in_report("shadow.txt"),
    };
    if let Some(path) = &program.output {
        fs::write(path, "").map_err(RunError::file(path))?;
    }
    let topic = program.candidate.topics().output;
    let record = Record::new(options.stage, topic, in_report("shadow.csv").as_deref())?;
    let shadowing = Shadowing::begin(options, &program, run, &signals, record)?;
    let record = shadowing.run(observe)?;
    let report = Report::of(options.stage.name(), &options.command, &record);
    if let Some(path) = in_report("shadow.json") {
        let text = serde_json::to_string_pretty(&report);
        let text = text.map_err(|error| format!("cannot write shadow.json: {error}"))?;
        fs::write(&path, text).map_err(RunError::file(&path))?;
    }
    Ok(report)
}

/// Returns the program, in a run like the observed one but lossless: the scans that the run's
/// masking has dropped are not sent at all.
fn candidate(run: &Run, options: &Options) -> Result<Candidate, RunError> {
    let manifest = run.manifest();
    let configuration = manifest.root.join("config.toml");
    Ok(Candidate {
        stage: options.stage,
        command: options.command.clone(),
        scheduling: options.scheduling.clone(),
        manifest: Manifest {
            live: false,
            window: Window {
                live_depth: 0,
                observers: 0,
                ..manifest.window
            },
            ..manifest.clone()
        },
        configuration: fs::read_to_string(&configuration)
            .map_err(RunError::file(&configuration))?,
    })
}
