//! The configuration of a run, with the overrides of the command line.

use std::path::PathBuf;

use gyre_configuration::{Configuration, calibration, strict::path_value};
use gyre_results::absolute;
use gyre_run::PlayedFrom;
use gyre_terminal::inputs::Given;
use gyre_terminal::{Failure, print};

use super::results_folder;
use crate::cli::RunArguments;

/// Reads the configuration and resolves its open settings.
pub fn resolve(arguments: &RunArguments) -> Result<Configuration, Failure> {
    let given = arguments.given()?;
    if arguments.from.is_some() && given.data.is_none() {
        return Err(
            "--from plays a recording of a run: name it, as in `gyre run NAME.mcap --from masked`"
                .into(),
        );
    }
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
    let calibration = arguments.calibration.as_deref().map(calibration::overrides);
    // As a value, which is quoted: a folder may be named 2019-01-10 or 7.
    let data = given.data.as_deref().map(path_value).transpose()?;
    let data = data.iter().flat_map(|data| {
        let data = format!("source.data={data}");
        [data, "source.kind='recording'".to_owned()]
    });
    let radar = given.radar.iter().flat_map(|address| {
        let address = toml::Value::from(address.clone());
        [
            "source.kind='colossus'".to_owned(),
            "run.mode='live'".to_owned(),
            format!("source.address={address}"),
        ]
    });
    let ros2 = arguments.ros2.iter().flat_map(|topic| {
        let topic = toml::Value::from(topic.clone());
        [
            "source.kind='ros2'".to_owned(),
            "run.mode='live'".to_owned(),
            format!("source.topic={topic}"),
        ]
    });
    let rate = options.rate.iter().map(|rate| format!("run.rate='{rate}'"));
    let from = arguments
        .from
        .iter()
        .map(|topic| format!("source.from='{topic}'"));
    let record = options.record.iter().map(|file| {
        let file = std::path::absolute(file).unwrap_or_else(|_| file.clone());
        Ok(format!("record.file={}", path_value(&file)?))
    });
    let record: Vec<String> = record.collect::<Result<_, Failure>>()?;
    let calibration = calibration.transpose()?.unwrap_or_default();
    let set = arguments.inputs.set.iter().cloned();
    Ok(calibration
        .into_iter()
        .chain(set)
        .chain(data)
        .chain(radar)
        .chain(ros2)
        .chain(rate)
        .chain(from)
        .chain(record)
        .collect())
}
