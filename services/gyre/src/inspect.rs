//! `gyre inspect`: reports the contents of a dataset.

use clap::Args;
use gyre_configuration::terminal::{
    Failure,
    inputs::{Inputs, configuration},
    print,
};
use gyre_datasets::InspectedLogs;

#[derive(Debug, Args)]
pub struct InspectArguments {
    #[command(flatten)]
    pub inputs: Inputs,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
}

pub fn inspect(arguments: &InspectArguments) -> Result<(), Failure> {
    let given = arguments.inputs.given_recording()?;
    let configuration = configuration(given.configuration.as_deref(), &arguments.inputs.set)?;
    let path = given.data.unwrap_or(configuration.source.data);
    let options = configuration.dataset;
    if path.as_os_str().is_empty() {
        return Err("name the recording to inspect: a folder, NAME.mcap or a bag of ROS 2".into());
    }
    let dataset = gyre_recording::open(&path, &options)?;
    let logs = InspectedLogs {
        gnss_topic: configuration.gnss.topic,
        m_per_tick: configuration.odometry.sensors.wheels.m_per_tick,
    };
    let report = gyre_datasets::inspect_dataset(&path, dataset, &options, &logs);
    match arguments.json {
        true => print::line(serde_json::to_string_pretty(&report)?),
        false => print::values(report),
    }
}
