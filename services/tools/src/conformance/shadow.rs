//! `gyre shadow`: a second program for a stage of a running run. It gets the same inputs as the
//! stage, its results are compared with the stage's and timed, and nobody uses them.
//!
//! To the run this process is an observer ([`gyre_client::observer`]): the run neither waits for it
//! nor fails with it. The program gets the observed items one at a time. The only cost for the
//! observed run is processor time.

mod life;
mod observation;
mod record;
mod renumbering;
mod shadowing;

use std::{fs, path::PathBuf, process::ExitCode, time::Duration};

use clap::Args;
use gyre_client::{Manifest, Run, RunError, Signals, control::Control};
use gyre_configuration::terminal::{Failure, own, print, seconds, words};
use gyre_contract::{FollowerId, Footprint, StageId, Window, run::StageConfig};
use gyre_results::{Content, Out};
use gyre_supervise::Scheduling;

use crate::{
    conformance::Candidate,
    doctor::check_shared_memory,
    operate::{RunChoice, chosen},
};

pub use record::{Beside, Counts, Report, Verdict};

use life::ShadowProgram;
use record::Record;
use shadowing::Shadowing;

#[derive(Debug, Args)]
pub struct ShadowArguments {
    /// The stage: masking, rotation-search, translation-search, joint-search or refinement.
    pub stage: String,
    #[command(flatten)]
    pub run: RunChoice,
    /// The program and its arguments, as in 'python3 stage.py --fast'; no shell is involved.
    /// Default: Gyre's own stage.
    #[arg(long, value_name = "COMMAND")]
    pub command: Option<String>,
    /// File of Python with a function in the place of a program: see docs/replace-a-stage.md.
    #[arg(long, value_name = "FILE", conflicts_with = "command")]
    pub python: Option<PathBuf>,
    /// Items to compare. Default: until the run ends.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub scans: Option<u64>,
    /// Time after which it ends, s.
    #[arg(long, value_name = "S", value_parser = seconds)]
    pub duration: Option<Duration>,
    /// Write shadow.json, shadow.csv with a row for each item, and the program's output,
    /// shadow.txt, to this folder.
    #[arg(long, value_name = "DIR")]
    pub report: Option<PathBuf>,
    /// Niceness of the program, -20 to 19: the run goes first.
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(i32).range(-20..=19))]
    pub nice: i32,
    /// Time for the program to open its topics, s.
    #[arg(long, default_value = "30", value_name = "S", value_parser = seconds)]
    pub start_timeout_s: Duration,
    /// Time for the program to answer an item, s.
    #[arg(long, default_value = "10", value_name = "S", value_parser = seconds)]
    pub patience_s: Duration,
    /// Print JSON instead of a table.
    #[arg(long)]
    pub json: bool,
}

impl ShadowArguments {
    fn command(&self, stage: StageId) -> Result<Vec<String>, Failure> {
        let (gyre, python) = (own(), self.python.as_deref());
        match &self.command {
            Some(command) => words(command),
            None => Ok(StageConfig::own_command(
                &gyre.to_string_lossy(),
                stage.name(),
                python,
            )),
        }
    }
}

/// The exit code is 1 if nothing was compared, or the program died, hung or broke the contract.
pub fn shadow(arguments: &ShadowArguments) -> Result<ExitCode, Failure> {
    let stage = stage(&arguments.stage)?;
    let command = arguments.command(stage)?;
    let folder = arguments.report.as_deref();
    let locked = folder.map(|folder| Out::lock_for(folder, Content::SHADOW));
    let _locked = locked.transpose()?;
    let control = chosen(&arguments.run)?;
    require_stage(&control, stage)?;
    let run = Run::open(control.out())?;
    let manifest = run.manifest();
    let window = Window {
        observers: 0,
        ..manifest.window
    };
    check_shared_memory(&Footprint::new(&window, &manifest.limits))?;
    let report = compare(&run, stage, command, arguments)?;
    match arguments.json {
        true => print::line(serde_json::to_string_pretty(&report)?)?,
        false => print::line(&report)?,
    }
    Ok(match report.is_sound() {
        true => ExitCode::SUCCESS,
        false => ExitCode::FAILURE,
    })
}

fn stage(name: &str) -> Result<StageId, Failure> {
    let stages: Vec<&str> = StageId::between().map(StageId::name).collect();
    let stages = stages.join(", ");
    let stage = StageId::by_name(name);
    if let Some(stage) = StageId::between().find(|it| Some(*it) == stage) {
        return Ok(stage);
    }
    let reason = match stage {
        Some(StageId::RadarReplay) => "is a source, which has no inputs",
        Some(_) => "adds up all motions since the start of the run and owns its journal",
        None if FollowerId::by_name(name).is_some() => "reads the run's logs and no topics",
        None => {
            return Err(
                format!("there is no stage `{name}`; these can have a shadow: {stages}").into(),
            );
        }
    };
    Err(format!("{name} cannot have a shadow, since it {reason}; these can: {stages}").into())
}

/// Requires that the run has the stage: joint-search stands in the place of the other two searches.
fn require_stage(control: &Control, stage: StageId) -> Result<(), Failure> {
    let processes = control.status()?.processes;
    let names: Vec<_> = processes.iter().map(|it| it.name.as_str()).collect();
    let (stage, list) = (stage.name(), names.join(", "));
    match names.contains(&stage) {
        true => Ok(()),
        false => Err(format!("the run has no {stage}; it has {list}").into()),
    }
}

/// Compares until the run ends, a limit is reached, or a signal requests a stop. Faults of the
/// program are in the report, not in the error.
fn compare(
    run: &Run,
    stage: StageId,
    command: Vec<String>,
    arguments: &ShadowArguments,
) -> Result<Report, Failure> {
    let signals = Signals::install()?;
    let in_report = |name| arguments.report.as_ref().map(|folder| folder.join(name));
    let folder = tempfile::Builder::new().prefix("gyre-shadow-").tempdir();
    let folder = folder.map_err(RunError::file(&std::env::temp_dir()))?;
    let program = ShadowProgram {
        candidate: candidate(run, stage, command, arguments.nice)?,
        folder: folder.path().to_owned(),
        output: in_report("shadow.txt"),
    };
    if let Some(path) = &program.output {
        fs::write(path, "").map_err(RunError::file(path))?;
    }
    let topic = program.candidate.topics().output;
    let record = Record::new(stage, topic, in_report("shadow.csv").as_deref())?;
    let record = Shadowing::begin(arguments, &program, run, &signals, record)?.run()?;
    let report = Report::of(&program.candidate, &record);
    if let Some(path) = in_report("shadow.json") {
        let text = serde_json::to_string_pretty(&report);
        let text = text.map_err(|error| format!("cannot write shadow.json: {error}"))?;
        fs::write(&path, text).map_err(RunError::file(&path))?;
    }
    Ok(report)
}

/// Returns the program, in a run like the observed one but lossless: the scans that the run's
/// masking has dropped are not sent at all.
fn candidate(
    run: &Run,
    stage: StageId,
    command: Vec<String>,
    nice: i32,
) -> Result<Candidate, RunError> {
    let manifest = run.manifest();
    let configuration = manifest.root.join("config.toml");
    Ok(Candidate {
        stage,
        command,
        scheduling: Scheduling {
            nice: Some(nice),
            ..Scheduling::default()
        },
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
