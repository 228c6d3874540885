//! `gyre shadow`: runs a second program beside a stage of a running run, and compares their
//! results.

use std::{path::PathBuf, process::ExitCode, time::Duration};

use clap::Args;
use gyre_client::{Run, control::Control};
use gyre_configuration::terminal::{Failure, own, print, seconds, words};
use gyre_contract::{
    FollowerId, Footprint, StageId, Window,
    run::{Scheduling, StageConfig},
};
use gyre_results::{Content, Out};
use gyre_tools::{
    conformance::shadow::{self, Options},
    operate::{RunChoice, chosen},
};

use crate::preflight;

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

/// The exit code is 1 if nothing was compared, or the program died, hung or broke the contract.
pub fn shadow(arguments: &ShadowArguments) -> Result<ExitCode, Failure> {
    let stage = stage(&arguments.stage)?;
    let options = options(arguments, stage)?;
    let report = arguments.report.as_deref();
    let report = report.map(|folder| Out::lock_for(folder, Content::SHADOW));
    let _locked = report.transpose()?;
    let control = chosen(&arguments.run)?;
    require_stage(&control, stage)?;
    let run = Run::open(control.out())?;
    let manifest = run.manifest();
    let window = Window {
        observers: 0,
        ..manifest.window
    };
    preflight::check_shared_memory(&Footprint::new(&window, &manifest.limits))?;
    let report = shadow::shadow(&run, &options, &mut |line| {
        print::note(format_args!("gyre shadow: {line}"));
    })?;
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

fn options(arguments: &ShadowArguments, stage: StageId) -> Result<Options, Failure> {
    let gyre = own().to_string_lossy().into_owned();
    let own = || StageConfig::own_command(&gyre, stage.name(), arguments.python.as_deref());
    let command = arguments.command.as_deref().map(words);
    Ok(Options {
        stage,
        command: command.transpose()?.unwrap_or_else(own),
        scheduling: Scheduling {
            nice: Some(arguments.nice),
            ..Scheduling::default()
        },
        start_timeout: arguments.start_timeout_s,
        item_timeout: arguments.patience_s,
        scans: arguments.scans,
        duration: arguments.duration,
        report: arguments.report.clone(),
    })
}
