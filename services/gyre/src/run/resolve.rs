//! The configuration of a run, with the overrides of the command line.

use std::path::PathBuf;

use gyre_configuration::{
    Configuration, calibration,
    strict::path_value,
    terminal::{Failure, inputs::Given, print},
};
use gyre_contract::run::PlayedFrom;
use gyre_results::absolute;

use super::results_folder;
use crate::arguments::RunArguments;

pub fn resolve(arguments: &RunArguments) -> Result<Configuration, Failure> {
    let given = arguments.given()?;
    let overrides = overrides(arguments, &given)?;
    let mut configuration = given.read(&overrides)?;
    if given.data.is_some() {
        configuration.simulation = None;
    }
    configuration.leave_other_side();
    if configuration.is_radar() {
        // A recording beside it, with its constants and its truth, is of another drive.
        configuration.source.data = PathBuf::new();
    }
    let source = &mut configuration.source;
    if gyre_recording::is_recording(&source.data) && source.from == PlayedFrom::Scan {
        // Scans keep their numbers, and a recording may begin in the middle of a drive.
        let dataset = gyre_recording::open(&source.data, &configuration.dataset)?;
        source.first = source.first.max(dataset.first());
    }
    if let Some(simulation) = &configuration.simulation {
        // The constants of a simulated radar are known.
        configuration.dataset = configuration.dataset.or(&simulation.dataset_options());
        configuration.source.data = PathBuf::new();
    }
    configuration.odometry.masking.resolve()?;
    if configuration.objects.is_on() {
        configuration.odometry.masking.resolve_library()?;
    }
    let idle = configuration.without_effect(&arguments.inputs.set)?;
    idle.iter()
        .for_each(|sentence| print::note(format_args!("gyre: {sentence}")));
    // The run's processes receive the path of the run.
    path_value(&absolute(&results_folder(arguments)?)?)?;
    Ok(configuration)
}

/// The overrides: the calibration, `--set`, the options; of two for one key the later one holds.
fn overrides(arguments: &RunArguments, given: &Given) -> Result<Vec<String>, Failure> {
    let options = &arguments.options;
    let mut overrides = match &arguments.calibration {
        Some(file) => calibration::overrides(file)?,
        None => Vec::new(),
    };
    overrides.extend(arguments.inputs.set.iter().cloned());
    // As values, which are quoted: a folder may be named 2019-01-10 or 7.
    let mut set = |key: &str, value: toml::Value| overrides.push(format!("{key}={value}"));
    if let Some(data) = &given.data {
        set("source.data", path_value(data)?);
        set("source.kind", "recording".into());
    }
    let (address, topic) = (&given.radar, &arguments.ros2);
    for (kind, key, of_radar) in [
        ("colossus", "source.address", address),
        ("ros2", "source.topic", topic),
    ] {
        if let Some(of_radar) = of_radar {
            set("source.kind", kind.into());
            set("run.mode", "live".into());
            set(key, of_radar.clone().into());
        }
    }
    if let Some(rate) = &options.rate {
        set("run.rate", rate.to_string().into());
    }
    if let Some(topic) = &arguments.from {
        set("source.from", topic.clone().into());
    }
    if let Some(file) = &options.record {
        let file = std::path::absolute(file).unwrap_or_else(|_| file.clone());
        set("record.file", path_value(&file)?);
    }
    Ok(overrides)
}
