//! `gyre inspect`: reports what a dataset contains.

use std::process::ExitCode;

use gyre_configuration::Configuration;
use gyre_radar::ground_truth::read_trajectory;
use gyre_terminal::{Failure, print};

use crate::cli::InspectArguments;

/// Prints what a dataset contains and what looks wrong with it.
///
/// # Errors
/// A folder that is not a dataset, a trajectory that cannot be read, a key that is none.
pub fn inspect(arguments: &InspectArguments) -> Result<ExitCode, Failure> {
    let trajectory = arguments
        .trajectory
        .as_deref()
        .map(read_trajectory)
        .transpose()?;
    let (path, options) = (
        &arguments.path,
        Configuration::of_overrides(&arguments.set)?.dataset,
    );
    let dataset = gyre_recording::open(path, &options)?;
    let report = gyre_radar::inspect_dataset(path, dataset, &options, trajectory.as_ref());
    match arguments.json {
        true => print::line(serde_json::to_string_pretty(&report)?)?,
        false => print::line(report)?,
    }
    Ok(ExitCode::SUCCESS)
}
