//! The arguments that several commands share, and the arguments of optional commands.

mod link;
mod ros2;

use std::{io::IsTerminal, path::PathBuf};

use clap::Args;
use gyre_configuration::terminal::{
    Failure,
    inputs::{Given, Inputs},
};
use gyre_contract::run::Rate;
use gyre_results::Form;

pub use link::{LinkEnd, NetworkArguments, ReceiveArguments, SendArguments};
pub use ros2::Ros2Arguments;

#[derive(Default, Debug, Args)]
pub struct RunArguments {
    #[command(flatten)]
    pub inputs: Inputs,
    /// Play a recording from this topic on, without the stages before it: masked, rotation, motion
    /// or refined (source.from).
    #[arg(long, value_name = "TOPIC")]
    pub from: Option<String>,
    /// The topic of ROS 2 on which Navtech's driver publishes azimuths, as in /radar_data/fft_data:
    /// run live (source.kind, source.topic, run.mode).
    #[arg(long, value_name = "TOPIC")]
    pub ros2: Option<String>,
    /// The constants of the radar, of `gyre calibrate`, which override the configuration.
    #[arg(long, value_name = "FILE")]
    pub calibration: Option<PathBuf>,
    #[command(flatten)]
    pub options: RunOptions,
}

#[derive(Default, Debug, Args)]
pub struct RunOptions {
    /// The folder of the results. Default: `out/NAME`, NAME being the configuration's, or without
    /// one the dataset's.
    #[arg(long, value_name = "FOLDER")]
    pub out: Option<PathBuf>,
    /// Pace of the source: realtime, max, or a factor (run.rate).
    #[arg(long)]
    pub rate: Option<Rate>,
    /// Record the run to this file, NAME.mcap (record.file).
    #[arg(long, value_name = "FILE", value_parser = crate::record::recording)]
    pub record: Option<PathBuf>,
    /// Print all figures at the end, as where the output is no terminal.
    #[arg(short, long)]
    pub verbose: bool,
    /// Print the figures as JSON, as in summary.json.
    #[arg(long, conflicts_with = "verbose")]
    pub json: bool,
    /// Start from the first scan: discard an unfinished run in --out, replace the results of
    /// another or of a live run.
    #[arg(long)]
    pub fresh: bool,
}

impl RunOptions {
    pub fn form(&self) -> Form {
        match (self.json, self.verbose || !std::io::stdout().is_terminal()) {
            (true, _) => Form::Json,
            (false, true) => Form::Table,
            (false, false) => Form::Brief,
        }
    }
}

impl RunArguments {
    pub fn given(&self) -> Result<Given, Failure> {
        let given = self.inputs.given()?;
        let has_source = given.data.is_some() || given.radar.is_some();
        match self.ros2.is_some() && has_source {
            true => Err("--ros2 names a radar, and another source is named too: name one".into()),
            false => Ok(given),
        }
    }
}
