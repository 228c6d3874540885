//! The process of a drive: a run that knows whether it has been computed, and that reports the kind
//! of a failure by its exit code.

use std::{
    path::Path,
    process::ExitCode,
    thread,
    time::{Duration, Instant},
};

use gyre_batch::DriveOutcome;
use gyre_configuration::{
    AutomaticError, Configuration, ConfigurationError, SourceError, paths::shipped,
};
use gyre_datasets::OpenError;
use gyre_masking::MaskerError;
use gyre_results::{Form, Holds, Identity, Out, OutError, Problem, SUMMARY};
use gyre_simulator::SimulatorError;
use gyre_stage::run::end_with;
use gyre_terminal::{Failure, INTERRUPTED, print};
use rustix::process::Signal;
use thiserror::Error;

use crate::{
    cli::{BatchDriveArguments, RunArguments},
    earlier,
    preflight::PreflightError,
    program,
    run::{self, resolve},
};

/// The run of a batch that was killed writes its results for so long, and has its folder meanwhile.
const ENDING: Duration = Duration::from_secs(60);
/// Time between two attempts to lock the folder.
const LOOK: Duration = Duration::from_millis(200);

/// Why a drive cannot be computed, where a run would not look.
#[derive(Debug, Error)]
enum DriveError {
    #[error("there is nothing at {0}")]
    Missing(String),
    #[error(
        "the configuration is of {0}, which has no end: a batch is of recordings and simulations"
    )]
    Endless(String),
    #[error("{0}")]
    Configuration(Failure),
}

/// Computes a drive, unless it has been computed with the same configuration from the same scans.
/// The exit code reports the outcome.
pub fn drive(arguments: &BatchDriveArguments) -> Result<ExitCode, Failure> {
    if !end_with(arguments.parent, Signal::TERM)? {
        return Ok(DriveOutcome::Interrupted.exit_code(false).into());
    }
    let (outcome, earlier) = match computed(&arguments.run) {
        Ok(ended) => ended,
        Err(error) => {
            print::note(format_args!("gyre: {error}"));
            (outcome_of(&error), false)
        }
    };
    Ok(outcome.exit_code(earlier).into())
}

/// Returns how the drive has ended, and whether it had before.
fn computed(arguments: &RunArguments) -> Result<(DriveOutcome, bool), Failure> {
    // Input that existed when the batch began may be gone.
    let given = &arguments.inputs;
    let path = given.data.as_ref().or(given.what.first());
    let is_missing = |path: &Path| matches!(path.try_exists(), Ok(false));
    if let Some(path) = path.filter(|path| is_missing(path) && shipped(path).is_none()) {
        return Err(DriveError::Missing(path.display().to_string()).into());
    }
    let mut configuration = resolve(arguments).map_err(of_settings)?;
    if configuration.is_radar() || configuration.source.repeat {
        return Err(DriveError::Endless(configuration.data()).into());
    }
    let out = locked(&run::results_folder(arguments)?)?;
    // The folder is judged by the run that it is of.
    earlier::settle(&out)?;
    run::place_recording(&mut configuration, &out);
    if is_finished(&out, &configuration) {
        return finished(&out).map(|outcome| (outcome, true));
    }
    let discards = !continues(&out, &configuration)?;
    let code = run::compute(configuration, out, discards, Form::Table)?;
    Ok(match code == ExitCode::from(INTERRUPTED) {
        true => (DriveOutcome::Interrupted, false),
        false => (DriveOutcome::Complete, false),
    })
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

/// Returns whether the folder has the results of all these scans with this configuration.
fn is_finished(out: &Out, configuration: &Configuration) -> bool {
    let is_complete = earlier::is_complete(out.path()) && out.join(SUMMARY).exists();
    // If the source of the results is unknown, the run reports the unreadable file.
    let is_same =
        |begun: Identity| begun.has_inputs_of(configuration, &program::replaced(configuration)?);
    is_complete
        && Identity::read(out, Holds::Complete)
            .and_then(is_same)
            .unwrap_or(false)
}

/// Returns the outcome of a finished drive, and repeats its warnings.
fn finished(out: &Out) -> Result<DriveOutcome, Failure> {
    let text = gyre_storage::read_text(&out.join(SUMMARY), gyre_storage::SETTINGS)?;
    let summary: serde_json::Value = serde_json::from_str(&text)?;
    Ok(match summary["problem"].as_str() {
        None => DriveOutcome::Complete,
        Some(problem) => {
            print::note(format_args!("gyre: {problem}"));
            outcome_of_problem(problem)
        }
    })
}

/// Returns whether an unfinished run in the folder, if there is one, continues with this
/// configuration. One of another configuration, build or version is discarded, as are complete
/// results of such a run.
fn continues(out: &Out, configuration: &Configuration) -> Result<bool, Failure> {
    if earlier::is_of_another_version(out.path()) {
        return Ok(false);
    }
    let Ok(begun) = Identity::read(out, Holds::Unfinished(0)) else {
        return Ok(true);
    };
    let programs = program::now(configuration)?;
    let goes_on = begun.require(configuration, &programs, out.path(), Holds::Unfinished(0));
    // The run itself reports unreadable files, and keeps the results.
    let is_same = program::replaced(configuration)
        .map_err(Failure::from)
        .and_then(|replaced| begun.has_inputs_of(configuration, &replaced));
    Ok(goes_on.is_ok() && is_same.unwrap_or(true))
}

/// Marks a failure without a type of its own as a failure of the configuration.
fn of_settings(error: Failure) -> Failure {
    match error.is::<AutomaticError>() || error.is::<ConfigurationError>() {
        true => error,
        false => DriveError::Configuration(error).into(),
    }
}

fn outcome_of(failure: &Failure) -> DriveOutcome {
    if let Some(outcome) = DriveOutcome::of_full(&failure.to_string()) {
        return outcome;
    }
    if let Some(error) = failure.downcast_ref::<DriveError>() {
        return match error {
            DriveError::Missing(_) => DriveOutcome::Missing,
            DriveError::Endless(_) | DriveError::Configuration(_) => DriveOutcome::Configuration,
        };
    }
    if let Some(error) = failure.downcast_ref::<AutomaticError>() {
        return match error {
            AutomaticError::Open(error) => outcome_of_open(error),
            AutomaticError::Read(_) | AutomaticError::Empty => DriveOutcome::NotADataset,
            _ => DriveOutcome::Configuration,
        };
    }
    if let Some(error) = failure.downcast_ref::<SourceError>() {
        return match error {
            SourceError::Open(error) => outcome_of_open(error),
            _ => DriveOutcome::Configuration,
        };
    }
    if let Some(error) = failure.downcast_ref::<PreflightError>() {
        return outcome_of_preflight(error);
    }
    let is_configuration = failure.is::<ConfigurationError>()
        || failure.is::<MaskerError>()
        || failure.is::<SimulatorError>();
    match failure.downcast_ref::<OpenError>() {
        Some(error) => outcome_of_open(error),
        None if is_configuration => DriveOutcome::Configuration,
        None if failure.is::<Problem>() => outcome_of_problem(&failure.to_string()),
        None if matches!(failure.downcast_ref(), Some(OutError::Held { .. })) => {
            DriveOutcome::InUse
        }
        None => DriveOutcome::Failed,
    }
}

fn outcome_of_problem(sentence: &str) -> DriveOutcome {
    match sentence.contains(Problem::OF_MOTIONS) {
        true => DriveOutcome::Unsure,
        false => DriveOutcome::Corrupt,
    }
}

fn outcome_of_open(error: &OpenError) -> DriveOutcome {
    match error {
        OpenError::Missing { .. } => DriveOutcome::Missing,
        OpenError::BadOption { .. } | OpenError::DatasetToml { .. } => DriveOutcome::Configuration,
        _ => DriveOutcome::NotADataset,
    }
}

fn outcome_of_preflight(error: &PreflightError) -> DriveOutcome {
    match error {
        PreflightError::TooFew { .. } | PreflightError::NoRecording { .. } => {
            DriveOutcome::NotADataset
        }
        PreflightError::SharedMemory { .. }
        | PreflightError::OpenFiles { .. }
        | PreflightError::NoSharedMemory(_) => DriveOutcome::Machine,
        PreflightError::LiveLog(_)
        | PreflightError::LiveDoppler
        | PreflightError::LiveGnss { .. } => DriveOutcome::Configuration,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn failures_of_one_kind_have_one_outcome() {
        let path = || "a".into();
        let cases: [(Failure, DriveOutcome); 8] = [
            (
                DriveError::Missing("a".into()).into(),
                DriveOutcome::Missing,
            ),
            (
                OpenError::Missing { path: path() }.into(),
                DriveOutcome::Missing,
            ),
            (
                OpenError::NoImages { path: path() }.into(),
                DriveOutcome::NotADataset,
            ),
            (
                AutomaticError::Open(OpenError::NoImages { path: path() }).into(),
                DriveOutcome::NotADataset,
            ),
            (
                PreflightError::OpenFiles { limit: 1 }.into(),
                DriveOutcome::Machine,
            ),
            (of_settings("a card".into()), DriveOutcome::Configuration),
            ("masking died".into(), DriveOutcome::Failed),
            (
                "cannot write b: No space left on device (os error 28)".into(),
                DriveOutcome::DiskFull,
            ),
        ];
        for (failure, outcome) in cases {
            assert_eq!(outcome_of(&failure), outcome, "{failure}");
        }
    }
}
