//! A build without ROS 2.

use std::process::ExitCode;

use gyre_datasets::DatasetOptions;
use gyre_run::SourceConfig;
use gyre_stage::{Launch, StageCounters, StageError};
use gyre_stages::live_radar::Sizes;
use gyre_terminal::Failure;

use crate::{cli::Ros2Arguments, features::absent};

const PART: &str = "ROS 2";

pub fn publish(_: &Ros2Arguments) -> Result<ExitCode, Failure> {
    Err(absent(PART).into())
}

pub fn ask(_: &SourceConfig, _: &DatasetOptions) -> Result<Sizes, Failure> {
    Err(absent(PART).into())
}

pub fn receive(
    _: &Launch,
    _: &SourceConfig,
    _: &DatasetOptions,
) -> Result<StageCounters, StageError> {
    Err(StageError::Input(absent(PART)))
}
