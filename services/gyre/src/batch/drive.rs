//! The process of a drive: a run that knows whether it has been computed, and that reports its
//! outcome.

use std::{
    path::Path,
    process::ExitCode,
    thread,
    time::{Duration, Instant},
};

use gyre_configuration::{Configuration, paths::shipped};
use gyre_results::{Form, HARDLY_MEASURED, Identity, Out, OutError, SUMMARY};
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
    let end = end.unwrap_or_else(|error| End::of(Outcome::Failed, error.to_string()));
    print::line(serde_json::to_string(&end)?)?;
    Ok(ExitCode::SUCCESS)
}

fn computed(arguments: &RunArguments) -> Result<End, Failure> {
    // The recording may have been removed since the batch began.
    let path = arguments.inputs.what.last();
    let is_missing = |path: &Path| matches!(path.try_exists(), Ok(false));
    if let Some(path) = path.filter(|path| is_missing(path) && shipped(path).is_none()) {
        return Ok(End::unchecked(format!(
            "there is nothing at {}",
            path.display()
        )));
    }
    let mut configuration = resolve(arguments)?;
    if configuration.is_radar() || configuration.source.repeat {
        return Err(format!(
            "the configuration is of {}, which has no end: a batch is of recordings and simulations",
            configuration.data()
        )
        .into());
    }
    let out = match locked(&run::results_folder(arguments)?) {
        Err(error @ OutError::Held { .. }) => return Ok(End::unchecked(error.to_string())),
        out => out?,
    };
    // The folder is judged by the run that it is of.
    earlier::settle(&out)?;
    run::place_recording(&mut configuration, &out);
    if is_finished(&out, &configuration) {
        return finished(out.path(), true);
    }
    let discards = !continues(&out, &configuration)?;
    let results = out.path().to_owned();
    match run::compute(configuration, out, discards, Form::Table)? {
        code if code == ExitCode::from(INTERRUPTED) => Ok(End::interrupted()),
        _ => finished(&results, false),
    }
}

/// Locks the folder of the results, when the run that ends there has ended.
fn locked(path: &Path) -> Result<Out, OutError> {
    let deadline = Instant::now() + ENDING;
    loop {
        match Out::lock(path) {
            Err(OutError::Held { .. }) if Instant::now() < deadline => thread::sleep(LOOK),
            locked => return locked,
        }
    }
}

fn is_same(begun: &Identity, configuration: &Configuration) -> Result<bool, Failure> {
    let replaced = program::replaced(configuration)?;
    begun.has_inputs_of(configuration, &replaced)
}

/// Returns whether the folder has the results of these scans, by whatever build.
fn is_finished(out: &Out, configuration: &Configuration) -> bool {
    let is_complete = earlier::is_complete(out.path()) && out.join(SUMMARY).exists();
    // A run reports files that cannot be read.
    is_complete
        && Identity::read(out)
            .and_then(|begun| is_same(&begun, configuration))
            .unwrap_or(false)
}

/// Returns the end of a finished drive; `earlier`: it had ended so before.
fn finished(results: &Path, earlier: bool) -> Result<End, Failure> {
    let text = gyre_storage::read_text(&results.join(SUMMARY), gyre_storage::SETTINGS)?;
    let summary: serde_json::Value = serde_json::from_str(&text)?;
    let problem = summary["problem"].as_str();
    let outcome = match problem {
        None => Outcome::Complete,
        Some(problem) if problem.contains(HARDLY_MEASURED) => Outcome::Unsure,
        Some(_) => Outcome::Corrupt,
    };
    Ok(End {
        outcome,
        earlier,
        unchecked: false,
        sentence: problem.unwrap_or_default().to_owned(),
    })
}

/// A run of another configuration, build or version is discarded.
fn continues(out: &Out, configuration: &Configuration) -> Result<bool, Failure> {
    let earlier = Earlier::of(out, configuration, &program::now(configuration)?, false)?;
    Ok(match (&earlier, earlier.identity()) {
        (Earlier::Foreign(_) | Earlier::Complete(_), _) => false,
        // The run reports files that cannot be read, and keeps its poses.
        (_, Some(begun)) => is_same(begun, configuration).unwrap_or(true),
        (_, None) => true,
    })
}
