//! The process of a drive: a run that knows whether it has been computed, and that reports its
//! outcome.

use std::{
    process::ExitCode,
    thread,
    time::{Duration, Instant},
};

use gyre_configuration::paths::shipped;
use gyre_results::{Form, Identity, Out, OutError, SUMMARY};
use gyre_stage::run::end_with;
use gyre_terminal::{Failure, INTERRUPTED, print};
use gyre_tools::batch::{End, Outcome};
use rustix::process::Signal;

use crate::{
    arguments::RunArguments,
    earlier::{self, Earlier},
    program,
    run::{self, resolve},
};

/// The run of a batch that was killed writes its results for so long, and has its folder meanwhile.
const ENDING: Duration = Duration::from_secs(60);
const LOOK: Duration = Duration::from_millis(200);

/// Computes a drive, unless it has been computed with the same configuration from the same scans,
/// and prints its end.
pub fn drive(parent: i32, run: &RunArguments) -> Result<ExitCode, Failure> {
    if !end_with(parent, Signal::TERM)? {
        return Ok(ExitCode::FAILURE);
    }
    let end = computed(run);
    let end = end.unwrap_or_else(|error| End::new(Outcome::Failed, false, error.to_string()));
    print::line(serde_json::to_string(&end)?)?;
    Ok(ExitCode::SUCCESS)
}

fn computed(arguments: &RunArguments) -> Result<End, Failure> {
    let unchecked = |reason: String| Ok(End::new(Outcome::Failed, true, reason));
    // The recording may have been removed since the batch began.
    if let Some(path) = arguments.inputs.what.last()
        && matches!(path.try_exists(), Ok(false))
        && shipped(path).is_none()
    {
        return unchecked(format!("there is nothing at {}", path.display()));
    }
    let mut configuration = resolve(arguments)?;
    if configuration.is_radar() || configuration.source.repeat {
        return Err(format!(
            "the configuration is of {}, which has no end: a batch is of recordings and simulations",
            configuration.data()
        )
        .into());
    }
    let (folder, deadline) = (run::results_folder(arguments)?, Instant::now() + ENDING);
    let out = loop {
        match Out::lock(&folder) {
            Err(OutError::Held(_)) if Instant::now() < deadline => thread::sleep(LOOK),
            Err(held @ OutError::Held(_)) => return unchecked(held.to_string()),
            out => break out?,
        }
    };
    // The folder is judged by the run that it is of.
    earlier::settle(&out)?;
    run::place_recording(&mut configuration, &out);
    // By whatever build. `None`: a run reports files that cannot be read, and keeps its poses.
    let is_same = Identity::read(&out)
        .and_then(|begun| begun.has_inputs_of(&configuration, &program::replaced(&configuration)?))
        .ok();
    let is_complete = earlier::is_complete(out.path()) && out.join(SUMMARY).exists();
    if is_complete && is_same == Some(true) {
        return Ok(End::new(Outcome::Complete, true, ""));
    }
    // A run of another configuration, build or version is discarded.
    let earlier = Earlier::of(&out, &configuration, &program::now(&configuration)?, false)?;
    let discards = match &earlier {
        Earlier::Foreign(_) | Earlier::Complete(_) => true,
        begun => begun.identity().is_some() && is_same == Some(false),
    };
    match run::compute(configuration, out, discards, Form::Table)? {
        code if code == ExitCode::from(INTERRUPTED) => Ok(End::interrupted()),
        _ => Ok(End::new(Outcome::Complete, false, "")),
    }
}
