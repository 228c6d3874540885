//! `gyre record`: records a running run, from outside or as a process of it.

use std::{path::PathBuf, process::ExitCode, time::Duration};

use clap::Args;
use gyre_configuration::terminal::{Failure, print, seconds};
use gyre_contract::run::RecordConfig;
use gyre_tools::operate::RunChoice;
use gyre_watch::recorder::{Options, Split};

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
    /// Size of a file before the recording continues in the next file, MB; 0: any.
    #[arg(long, default_value_t = 0, value_name = "MB")]
    pub split_mb: u64,
    /// Time of the sensor before the recording continues in the next file, s; 0: any.
    #[arg(long, default_value = "0", value_name = "S", value_parser = seconds)]
    pub split_s: Duration,
    /// Size of all files before the oldest one is removed, MB; 0: any. Needs --split-mb or
    /// --split-s.
    #[arg(long, default_value_t = 0, value_name = "MB")]
    pub keep_mb: u64,
    /// Age of a complete file before it is removed, s; 0: any. Needs --split-mb or --split-s.
    #[arg(long, default_value = "0", value_name = "S", value_parser = seconds)]
    pub keep_s: Duration,
    /// Continue with the next part of the recording if there is one (as `gyre run` starts it).
    #[arg(long, hide = true)]
    pub continues: bool,
}

/// Parses the name of a recording. Readers recognise the format by the ending.
pub fn recording(text: &str) -> Result<PathBuf, String> {
    match text.strip_suffix(".mcap") {
        Some(name) if !name.is_empty() && !name.ends_with('/') => Ok(text.into()),
        _ => Err("the name of a recording ends in .mcap".to_owned()),
    }
}

pub fn record(arguments: &RecordArguments) -> Result<ExitCode, Failure> {
    let limits = RecordConfig {
        split_mb: arguments.split_mb,
        split_s: arguments.split_s.as_secs_f64(),
        keep_mb: arguments.keep_mb,
        keep_s: arguments.keep_s.as_secs_f64(),
        ..RecordConfig::default()
    };
    if limits.keeps_whole() {
        return Err(
            "--keep-mb and --keep-s remove whole files: add --split-mb or --split-s".into(),
        );
    }
    let bytes_of = |mb: u64| (mb > 0).then_some(mb.saturating_mul(1_000_000));
    let span_ns = i64::try_from(arguments.split_s.as_nanos()).unwrap_or(i64::MAX);
    let options = Options {
        out: arguments.run.folder()?,
        to: arguments.to.clone(),
        topics: arguments.topics.clone(),
        split: Split {
            bytes: bytes_of(arguments.split_mb),
            span_ns: (span_ns > 0).then_some(span_ns),
            keep_bytes: bytes_of(arguments.keep_mb),
            keep_age: Some(arguments.keep_s).filter(|it| !it.is_zero()),
        },
        continues: arguments.continues,
    };
    Ok(match gyre_watch::recorder::record(&options) {
        Ok(recorded) => {
            print::note(&recorded);
            // To the run it is no failure, and no reason for a restart.
            match recorded.is_complete() || arguments.continues {
                true => ExitCode::SUCCESS,
                false => ExitCode::FAILURE,
            }
        }
        Err(error) => {
            print::note(format_args!("gyre record: {error}"));
            ExitCode::from(error.exit_code())
        }
    })
}
