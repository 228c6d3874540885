//! The arguments of `gyre shadow`.

use std::path::PathBuf;

use clap::Args;
use gyre_tools::operate::RunChoice;

#[derive(Debug, Args)]
pub struct ShadowArguments {
    /// The stage: masking, rotation-search, translation-search, joint-search or refinement.
    pub stage: String,
    #[command(flatten)]
    pub run: RunChoice,
    /// The program and its arguments, as in 'python3 stage.py --fast'; no shell is involved.
    /// Default: Gyre's own stage.
    #[arg(long, value_name = "COMMAND")]
    pub command: Option<String>,
    /// File of Python with a function in the place of a program: see docs/replace-a-stage.md.
    #[arg(long, value_name = "FILE", conflicts_with = "command")]
    pub python: Option<PathBuf>,
    /// Items to compare. Default: until the run ends.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u64).range(1..))]
    pub scans: Option<u64>,
    /// Time after which it ends, s.
    #[arg(long, value_name = "S")]
    pub duration: Option<f64>,
    /// Write shadow.json, shadow.csv with a row for each item, and the program's output,
    /// shadow.txt, to this folder.
    #[arg(long, value_name = "DIR")]
    pub report: Option<PathBuf>,
    /// Niceness of the program, -20 to 19: the run goes first.
    #[arg(long, default_value_t = 10, value_parser = clap::value_parser!(i32).range(-20..=19))]
    pub nice: i32,
    /// Time for the program to open its topics, s.
    #[arg(long, default_value_t = 30.0, value_name = "S")]
    pub start_timeout_s: f64,
    /// Time for the program to answer an item, s.
    #[arg(long, default_value_t = 10.0, value_name = "S")]
    pub patience_s: f64,
    /// Print JSON instead of a table.
    #[arg(long)]
    pub json: bool,
}
