//! Shadow mode: a second program for a stage of a running run. It gets the same inputs as the
//! stage, its results are compared with the stage's and timed, and nobody uses them.
//!
//! To the run this process is an observer ([`gyre_stage::observer`]): the run neither waits for it
//! nor fails with it. The program runs in a run of its own, alone ([`gyre_harness`]), where this
//! process sends it the observed items, one at a time. It takes nothing from the observed run but
//! processor time.
//!
//! Reading order: [`shadow`], `shadowing` (the loop), `observation` (the items of the run),
//! `renumbering` (the items as the shadow gets them), `life` (the process), `record`, [`Report`].

mod error;
mod life;
mod observation;
mod options;
mod record;
mod renumbering;
mod report;
mod shadowing;

use std::fs;

use gyre_harness::Candidate;
use gyre_messages::{StageId, Window};
use gyre_stage::{Manifest, observer::ObservedRun, wake::Signals};

pub use error::ShadowError;
pub use options::Options;
pub use record::Counts;
pub use report::{Beside, Report, Spread, Spreads, Verdict};

use life::ShadowProgram;
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

/// Runs a program as the shadow of a stage until the run ends, a limit is reached, or a signal
/// requests a stop. `observe` receives lines about the progress.
///
/// # Errors
/// The run cannot be observed, the program cannot be started, or the report cannot be written. A
/// fault of the program is no error: the report says so.
pub fn shadow(
    run: &ObservedRun,
    options: &Options,
    observe: &mut dyn FnMut(&str),
) -> Result<Report, ShadowError> {
    let signals = Signals::install()?;
    let in_report = |name| options.report.as_ref().map(|folder| folder.join(name));
    if let Some(folder) = &options.report {
        let created = gyre_storage::create_folder(folder);
        created.map_err(|error| ShadowError::file(folder)(error.source))?;
    }
    let folder = tempfile::Builder::new().prefix("gyre-shadow-").tempdir();
    let folder = folder.map_err(ShadowError::file(&std::env::temp_dir()))?;
    let program = ShadowProgram {
        candidate: candidate(run, options)?,
        folder: folder.path().to_owned(),
        output: in_report("shadow.txt"),
    };
    if let Some(path) = &program.output {
        fs::write(path, "").map_err(ShadowError::file(path))?;
    }
    let topic = program.candidate.topics().output;
    let record = Record::new(options.stage, topic, in_report("shadow.csv").as_deref())?;
    let shadowing = Shadowing::begin(options, &program, run, &signals, record)?;
    let record = shadowing.run(observe)?;
    let report = Report::of(options.stage.name(), &options.command, &record);
    if let Some(path) = in_report("shadow.json") {
        let text = serde_json::to_string_pretty(&report)?;
        fs::write(&path, text).map_err(ShadowError::file(&path))?;
    }
    Ok(report)
}

/// Returns the program, in a run like the observed one but lossless: the scans that the run's
/// masking has dropped are not sent at all.
fn candidate(run: &ObservedRun, options: &Options) -> Result<Candidate, ShadowError> {
    let manifest = run.manifest();
    let configuration = manifest.root.join("config.toml");
    Ok(Candidate {
        stage: options.stage,
        command: options.command.clone(),
        scheduling: options.scheduling.clone(),
        gyre: options.gyre.clone(),
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
            .map_err(ShadowError::file(&configuration))?,
    })
}
