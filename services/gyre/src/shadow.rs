//! `gyre shadow`: runs a second program beside a stage of a running run, and compares their
//! results.

use std::process::ExitCode;

use gyre_client::{Run, control::Control};
use gyre_configuration::terminal::{Failure, print};
use gyre_contract::{FollowerId, Footprint, StageId, Window};
use gyre_results::{Content, Out};
use gyre_tools::{
    conformance::shadow::{self, ShadowArguments},
    operate::chosen,
};

use crate::preflight;

/// The exit code is 1 if nothing was compared, or the program died, hung or broke the contract.
pub fn shadow(arguments: &ShadowArguments) -> Result<ExitCode, Failure> {
    let stage = stage(&arguments.stage)?;
    let command = arguments.command(stage)?;
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
    let report = shadow::shadow(&run, stage, command, arguments, &mut |line| {
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
