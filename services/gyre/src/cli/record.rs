//! The arguments of `gyre record`.

use std::path::PathBuf;

use clap::Args;
use gyre_tools::operate::RunChoice;

#[derive(Debug, Args)]
pub struct RecordArguments {
    #[command(flatten)]
    pub run: RunChoice,
    /// The file to write: NAME.mcap.
    #[arg(long, value_name = "FILE", value_parser = recording)]
    pub to: PathBuf,
    /// The topics that are recorded: scan, masked, rotation, motion, refined, pose, loop,
    /// correction, fix, log, health. Default: all of these in the run except masked and rotation.
    #[arg(long, value_delimiter = ',')]
    pub topics: Vec<String>,
    #[command(flatten)]
    pub split: SplitArguments,
    /// Continue with the next part of the recording if there is one (as `gyre run` starts it).
    #[arg(long, hide = true)]
    pub continues: bool,
}

/// When a file of a recording is ended and the next one begun.
#[derive(Clone, Copy, Debug, Args)]
pub struct SplitArguments {
    /// Size of a file before the recording continues in the next file, MB; 0: any.
    #[arg(long, default_value_t = 0, value_name = "MB")]
    pub split_mb: u64,
    /// Time of the sensor before the recording continues in the next file, s; 0: any.
    #[arg(long, default_value_t = 0.0, value_name = "S")]
    pub split_s: f64,
}

/// Parses the name of a recording. Readers recognise the format by the ending.
pub fn recording(text: &str) -> Result<PathBuf, String> {
    match text.strip_suffix(".mcap") {
        Some(name) if !name.is_empty() && !name.ends_with('/') => Ok(text.into()),
        _ => Err("the name of a recording ends in .mcap".to_owned()),
    }
}
