//! The arguments of the commands that operate running runs.

use std::path::PathBuf;

use clap::Args;

/// The run that a command is about.
#[derive(Debug, Args)]
pub struct RunChoice {
    /// The run: the folder of its results. Default: the only run there is; a command that changes a
    /// run takes only one that was started from the current folder.
    #[arg(value_name = "RUN")]
    pub run: Option<PathBuf>,
}

#[derive(Debug, Args)]
pub struct PsArguments {
    /// The run to list. Default: all runs of this user.
    #[command(flatten)]
    pub run: RunChoice,
    /// Print JSON.
    #[arg(long)]
    pub json: bool,
    /// Fail unless a run is running, and all processes of each run work as they should: for health
    /// checks.
    #[arg(long)]
    pub check: bool,
}

#[derive(Debug, Args)]
pub struct LogsArguments {
    /// The process, as masking. Default: all.
    pub process: Option<String>,
    /// The run.
    #[command(flatten)]
    pub run: RunChoice,
    /// Continue with new lines, until the run ends.
    #[arg(short, long)]
    pub follow: bool,
    /// Number of lines to begin with, of each log.
    #[arg(short = 'n', long, default_value_t = 50)]
    pub lines: usize,
}

#[derive(Debug, Args)]
pub struct RestartArguments {
    /// The process, as masking.
    pub process: String,
    /// The run.
    #[command(flatten)]
    pub run: RunChoice,
}

#[derive(Debug, Args)]
pub struct SwapArguments {
    /// The process whose place is taken, as masking.
    pub process: String,
    /// The run.
    #[command(flatten)]
    pub run: RunChoice,
    /// The program that takes over and its arguments, as in 'python3 stage.py --fast'; no shell is
    /// involved. Default: the one that the run was begun with.
    #[arg(long, value_name = "COMMAND")]
    pub command: Option<String>,
    /// File of Python with a function in the place of a program: see docs/replace-a-stage.md.
    #[arg(long, value_name = "FILE", conflicts_with = "command")]
    pub python: Option<PathBuf>,
    /// End the program before first. For a program that cannot stand by; scans wait for it
    /// meanwhile, or are dropped in live mode.
    #[arg(long)]
    pub cold: bool,
}

#[derive(Debug, Args)]
pub struct TopArguments {
    /// The run.
    #[command(flatten)]
    pub run: RunChoice,
    /// Time between two looks, s.
    #[arg(long, default_value_t = 1.0, value_name = "S")]
    pub every: f64,
    /// Print one look as text and end.
    #[arg(long)]
    pub once: bool,
}
