//! The arguments of `gyre conformance`.

use std::path::PathBuf;

use clap::{Args, builder::PossibleValuesParser};
use gyre_messages::StageId;
use gyre_terminal::inputs::Inputs;

#[derive(Debug, Args)]
pub struct ConformanceArguments {
    /// The stage that the program replaces.
    #[arg(value_parser = PossibleValuesParser::new(StageId::ALL.map(StageId::name)))]
    pub stage: String,
    /// The program and its arguments, as in 'python3 stage.py --fast'; no shell is involved.
    /// Default: the command of the stage in the configuration, else Gyre's own stage.
    #[arg(long, value_name = "COMMAND")]
    pub command: Option<String>,
    /// File of Python with a function in the place of a program: see docs/replace-a-stage.md.
    #[arg(long, value_name = "FILE", conflicts_with = "command")]
    pub python: Option<PathBuf>,
    #[command(flatten)]
    pub inputs: Inputs,
    /// Scans to test with, 8 or more.
    #[arg(long, default_value_t = 24, value_parser = clap::value_parser!(u16).range(8..=1000))]
    pub scans: u16,
    /// The results must equal the results of Gyre's own stage, to the bit.
    #[arg(long)]
    pub same_as_own: bool,
    /// The 99th percentile of the work on an item must be at most this, ms; of fewer than a hundred
    /// items the maximum. The first four do not count.
    #[arg(long, value_name = "MS")]
    pub budget_ms: Option<f64>,
    /// Time for the program to open its topics, s.
    #[arg(long, default_value_t = 30.0, value_name = "S")]
    pub start_timeout_s: f64,
    /// Time for the program to answer an item, or to refuse it, s.
    #[arg(long, default_value_t = 10.0, value_name = "S")]
    pub patience_s: f64,
    /// Time for the program to exit after SIGTERM, s. A run gives it 2 s.
    #[arg(long, default_value_t = 2.0, value_name = "S")]
    pub stop_timeout_s: f64,
    /// Print JSON instead of a table.
    #[arg(long)]
    pub json: bool,
}
