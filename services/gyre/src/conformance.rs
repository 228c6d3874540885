//! `gyre conformance`: tests whether a program keeps the contract of a stage.

use std::process::ExitCode;

use gyre_configuration::{
    Configuration, describe_masks,
    terminal::{Failure, INTERRUPTED, inputs::Inputs, own, print, words},
    with_stored_options,
};
use gyre_contract::{StageId, run::Scheduling};
use gyre_tools::{
    conformance::{Candidate, ConformanceArguments, Report, Test, check},
    doctor::check_shared_memory,
};
use gyre_transport::{RunError, wake::Signals};

use crate::{
    arguments::{RunArguments, resolve},
    plan, preflight,
};

/// The shape of the program's messages matters, not the accuracy.
const SMALL: [&str; 2] = ["simulation.seed=1", "raster.n=127"];
/// Places for observers in addition to the places of a run; the test uses some.
const OBSERVERS: usize = 4;

/// The exit code if some rules could not be tested, which is no evidence against the program.
const NOT_TESTED: u8 = 2;

/// The exit code is 0 if it keeps the contract, 1 if not, and 2 if not all could be tested.
pub fn conformance(arguments: &ConformanceArguments) -> Result<ExitCode, Failure> {
    match examine(arguments) {
        Ok(Some(report)) => print(&report, arguments.json),
        Ok(None) => Ok(ExitCode::from(INTERRUPTED)),
        Err(error) => {
            print::note(format_args!("gyre: {error}"));
            Ok(ExitCode::from(NOT_TESTED))
        }
    }
}

fn examine(arguments: &ConformanceArguments) -> Result<Option<Report>, Failure> {
    let stage = StageId::by_name(&arguments.stage).ok_or("there is no such stage")?;
    let configuration = configuration(arguments, stage)?;
    let command = command(arguments, &configuration, stage)?;
    preflight::check_open_files()?;
    let checked = preflight::check(&configuration, &mut preflight::ask)?;
    check_shared_memory(&checked.footprint)?;
    describe_masks(&configuration)?.iter().for_each(print::note);
    let folder = tempfile::Builder::new()
        .prefix("gyre-conformance-")
        .tempdir()?;
    // Refuses a radar, which has no scans to test with again and again.
    gyre_configuration::open(&configuration)?;
    let test = Test {
        candidate: Candidate {
            stage,
            command,
            scheduling: Scheduling::default(),
            manifest: checked.manifest(&configuration, folder.path(), plan::digest(&own())?),
            configuration: configuration.to_toml()?,
        },
        stages: StageId::ALL
            .into_iter()
            .filter(|stage| configuration.has(*stage))
            .collect(),
        prepare: Box::new(move |root| match &checked.scans.recording {
            Some(recording) => recording.listing.write(root),
            None => Ok(()),
        }),
        arguments,
    };
    let signals = Signals::install()?;
    match check(&test, &signals) {
        Err(error) if matches!(error.downcast_ref(), Some(RunError::Stopped)) => Ok(None),
        report => report.map(Some),
    }
}

fn print(report: &Report, as_json: bool) -> Result<ExitCode, Failure> {
    match as_json {
        true => print::line(serde_json::to_string_pretty(report)?)?,
        false => print::line(report)?,
    }
    Ok(match (report.conforms(), report.broken()) {
        (true, _) => ExitCode::SUCCESS,
        (false, 0) => ExitCode::from(NOT_TESTED),
        (false, _) => ExitCode::FAILURE,
    })
}

fn configuration(
    arguments: &ConformanceArguments,
    stage: StageId,
) -> Result<Configuration, Failure> {
    let given = arguments.inputs.given_recording()?;
    let is_small = given.configuration.is_none() && given.data.is_none();
    let small = SMALL
        .iter()
        .filter(|_| is_small)
        .map(|key| (*key).to_owned());
    let python = arguments.python.iter().map(|file| {
        let file = toml::Value::from(file.to_string_lossy().into_owned());
        format!("stages.{}.python={file}", stage.name())
    });
    let lossless = ["run.mode='lossless'", "run.rate='max'"].map(str::to_owned);
    let resolved = resolve(&RunArguments {
        inputs: Inputs {
            set: small
                .chain(arguments.inputs.set.clone())
                .chain(python)
                .chain(lossless)
                .collect(),
            what: arguments.inputs.what.clone(),
        },
        ..RunArguments::default()
    })?;
    let mut configuration = with_stored_options(&resolved)?.streaming(None);
    configuration.source.scans = Some(arguments.scans.into());
    configuration.choose(stage);
    // Some scans must be under way while the motion of the oldest is not known.
    let least = configuration.odometry.masking.feedback_lag() + 2;
    configuration.run.window = configuration.run.window.max(least);
    configuration.run.observers = configuration.run.observers.max(OBSERVERS);
    Ok(configuration)
}

fn command(
    arguments: &ConformanceArguments,
    configuration: &Configuration,
    stage: StageId,
) -> Result<Vec<String>, Failure> {
    let (gyre, name) = (own().to_string_lossy().into_owned(), stage.name());
    match &arguments.command {
        Some(command) => words(command),
        None => {
            let configured = configuration.stages.get(name).cloned();
            Ok(configured.unwrap_or_default().command(&gyre, name))
        }
    }
}
