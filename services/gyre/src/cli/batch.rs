//! The arguments of `gyre batch`.

use std::{num::NonZeroUsize, path::PathBuf};

use clap::Args;

#[derive(Debug, Args)]
pub struct BatchArguments {
    /// The drives: a text file with the path of a recording in each line, a CSV file with the
    /// columns drive, name, configuration and set, or a folder whose sub-folders are recordings.
    pub list: PathBuf,
    /// The folder of the batch. The files of an earlier call are kept and completed.
    #[arg(long, default_value = "out/batch")]
    pub out: PathBuf,
    /// The configuration of the drives that name none. Default: settings from each recording's
    /// format and its scans.
    #[arg(long, value_name = "FILE")]
    pub config: Option<PathBuf>,
    /// Override a key of each configuration, as in slam.kind=graph; may be repeated.
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<String>,
    /// Runs at once. Default: as many as there are processors, since a run alone is bounded by its
    /// slowest stage.
    #[arg(long, value_name = "N")]
    pub jobs: Option<NonZeroUsize>,
    /// Compute only the drives of this task, from 0, of those that share the list.
    #[arg(long, value_name = "I", requires = "tasks")]
    pub task: Option<usize>,
    /// The number of tasks that share the list.
    #[arg(long, value_name = "N", requires = "task")]
    pub tasks: Option<usize>,
    /// Compute nothing: write the table of the existing results.
    #[arg(long, conflicts_with = "task")]
    pub collect: bool,
}
